"""What cameras see of a world: light baked by rays, pictures by filling polygons, mirrors and glass by rays."""
