"""The plugins of forge: what a workspace can do without. The core imports none of them."""
