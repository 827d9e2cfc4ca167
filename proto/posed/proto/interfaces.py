"""What the .proto files say of each interface. Made by `python proto/generate.py`.

Kept, not found out at run time: hashlib loads OpenSSL, 3.5 MB of every process that makes a call; and who
reads the options needs the descriptor of descriptors, half a megabyte.
"""

VERSIONS = {
    "posed.IServiceManager": 2,
    "posed.IServiceConnection": 2,
    "posed.ISensorService": 3,
    "posed.ISensorEventListener": 2,
    "posed.IDynamicSensorCallback": 1,
    "posed.IPoseService": 2,
    "posed.IPoseListener": 1,
}

HASHES = {
    "posed.IServiceManager": "1b84acd63e36734699d3e8176cad81210c2b81e89922166ea5d88a4385bd8465",
    "posed.IServiceConnection": "1b84acd63e36734699d3e8176cad81210c2b81e89922166ea5d88a4385bd8465",
    "posed.ISensorService": "53f2c55b5533508ac329be8a5c4577648df1c378099ca2fc381c84dc36d18de2",
    "posed.ISensorEventListener": "53f2c55b5533508ac329be8a5c4577648df1c378099ca2fc381c84dc36d18de2",
    "posed.IDynamicSensorCallback": "53f2c55b5533508ac329be8a5c4577648df1c378099ca2fc381c84dc36d18de2",
    "posed.IPoseService": "45fd697a5e4d48f04feed819bd925250f47252cbd12b63c29d7dbfa2cb7ef310",
    "posed.IPoseListener": "45fd697a5e4d48f04feed819bd925250f47252cbd12b63c29d7dbfa2cb7ef310",
}
"""SHA-256 of the serialised descriptors behind each interface."""

ONEWAY = {
    "posed.IServiceConnection.onBindingDied",
    "posed.ISensorEventListener.onSensorEvents",
    "posed.IDynamicSensorCallback.onDynamicSensorsChanged",
    "posed.IPoseListener.onPoseConfiguration",
}
