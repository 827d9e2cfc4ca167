"""SHA-256 of the serialised descriptors behind each interface. Made by `python proto/generate.py`.

Kept, not computed at run time: hashlib loads OpenSSL, 3.5 MB of every process that makes a call.
"""

HASHES = {
    "posed.IServiceManager": "f4172856b07360238841d2268929627911abf5fc781ea07e8ad22499ba5d6a4d",
    "posed.IServiceConnection": "f4172856b07360238841d2268929627911abf5fc781ea07e8ad22499ba5d6a4d",
    "posed.ISensorService": "6f8325bc6e6bf18eaaf3c2753bcfd7f2e6c266785cf6e76880c2052d367def33",
    "posed.ISensorEventListener": "6f8325bc6e6bf18eaaf3c2753bcfd7f2e6c266785cf6e76880c2052d367def33",
    "posed.IPoseService": "a316e4d9941478d93958efd2ec6a4bdffaf02cd70d29fc7db136453d83949bbf",
    "posed.IPoseListener": "a316e4d9941478d93958efd2ec6a4bdffaf02cd70d29fc7db136453d83949bbf",
}
