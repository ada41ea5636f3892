"""Who does the work: threads and processes of this machine (`pool`), or a cluster (`cluster`)."""
