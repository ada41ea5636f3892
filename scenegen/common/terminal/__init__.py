"""Pictures in terminals: what one can show (`abilities`), and how it is told (`pictures`)."""
