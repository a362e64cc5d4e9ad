"""What earlier runs found out, kept for the next: results, digests of files and of code.

`entries` holds results by the digest of all that they depend on, `index` what a driver knows of
files on this machine, `digests` and `code` the digests themselves, `keys` what depends on what, and
`recall` brings them together for a run.
"""
