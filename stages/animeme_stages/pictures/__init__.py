"""Pictures of characters that speak, and plots, on machines without a graphics card."""
