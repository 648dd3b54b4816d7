"""What worlds are made of: solids, textures, light, ground, and what moves."""
