"""Worlds for people and other programs to look at: pictures, a live page, meshes."""
