"""SHA-256 of the serialised descriptors behind each interface. Made by `python proto/generate.py`.

Kept, not computed at run time: hashlib loads OpenSSL, 3.5 MB of every process that makes a call.
"""

HASHES = {
    "posed.IServiceManager": "1b84acd63e36734699d3e8176cad81210c2b81e89922166ea5d88a4385bd8465",
    "posed.IServiceConnection": "1b84acd63e36734699d3e8176cad81210c2b81e89922166ea5d88a4385bd8465",
    "posed.ISensorService": "fb1e0799e61a38385c2ab9034f85b3592444e4181639fe3657eccaeac3cf4b01",
    "posed.ISensorEventListener": "fb1e0799e61a38385c2ab9034f85b3592444e4181639fe3657eccaeac3cf4b01",
    "posed.IDynamicSensorCallback": "fb1e0799e61a38385c2ab9034f85b3592444e4181639fe3657eccaeac3cf4b01",
    "posed.IPoseService": "a316e4d9941478d93958efd2ec6a4bdffaf02cd70d29fc7db136453d83949bbf",
    "posed.IPoseListener": "a316e4d9941478d93958efd2ec6a4bdffaf02cd70d29fc7db136453d83949bbf",
}
