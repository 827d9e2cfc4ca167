"""Pages over the SDK: who may see them, how values reach them, and what all of them share."""
