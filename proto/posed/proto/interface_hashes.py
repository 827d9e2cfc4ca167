"""SHA-256 of the serialised descriptors behind each interface. Made by `python proto/generate.py`.

Kept, not computed at run time: hashlib loads OpenSSL, 3.5 MB of every process that makes a call.
"""

HASHES = {
    "posed.IServiceManager": "1b84acd63e36734699d3e8176cad81210c2b81e89922166ea5d88a4385bd8465",
    "posed.IServiceConnection": "1b84acd63e36734699d3e8176cad81210c2b81e89922166ea5d88a4385bd8465",
    "posed.ISensorService": "53f2c55b5533508ac329be8a5c4577648df1c378099ca2fc381c84dc36d18de2",
    "posed.ISensorEventListener": "53f2c55b5533508ac329be8a5c4577648df1c378099ca2fc381c84dc36d18de2",
    "posed.IDynamicSensorCallback": "53f2c55b5533508ac329be8a5c4577648df1c378099ca2fc381c84dc36d18de2",
    "posed.IPoseService": "45fd697a5e4d48f04feed819bd925250f47252cbd12b63c29d7dbfa2cb7ef310",
    "posed.IPoseListener": "45fd697a5e4d48f04feed819bd925250f47252cbd12b63c29d7dbfa2cb7ef310",
}
