"""Android's Binder over ZeroMQ: stubs and proxies made from protobuf services, death links, caller identity."""
