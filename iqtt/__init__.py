"""3D-IQTT mental-rotation questions."""
