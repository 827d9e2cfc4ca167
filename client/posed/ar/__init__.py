"""The AR client: georeferenced content held in place by the fused pose, on a page."""
