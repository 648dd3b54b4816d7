"""The worlds, and the furniture, plants and people in them."""
