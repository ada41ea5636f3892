"""The paper's reference model, in torch: it meets data and scorer only through files."""
