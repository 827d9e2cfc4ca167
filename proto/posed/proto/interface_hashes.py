"""SHA-256 of the serialised descriptors behind each interface. Made by `python proto/generate.py`.

Kept, not computed at run time: hashlib loads OpenSSL, 3.5 MB of every process that makes a call.
"""

HASHES = {
    "posed.IServiceManager": "f4172856b07360238841d2268929627911abf5fc781ea07e8ad22499ba5d6a4d",
    "posed.IServiceConnection": "f4172856b07360238841d2268929627911abf5fc781ea07e8ad22499ba5d6a4d",
    "posed.ISensorService": "90ba86056c857dbfa016894f073900c87ec989c93e2e89000cafc5ad47637de3",
    "posed.ISensorEventListener": "90ba86056c857dbfa016894f073900c87ec989c93e2e89000cafc5ad47637de3",
    "posed.IPoseService": "04b3d3d6504af96937bcaa35b5b7d66129dd76127fb1b869cb79e9ef7323d52f",
    "posed.IPoseListener": "04b3d3d6504af96937bcaa35b5b7d66129dd76127fb1b869cb79e9ef7323d52f",
}
