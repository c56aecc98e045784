"""`python -m benchmarks peers`: Chapter 1's scene drawn by what else a person might write it in, beside our kernels.

A contestant is one way to the image (`registry`). Each lives in a process of its own (`worker`, spoken to by
`process`), because five compilers do not share one, and because its cold start is measured with it. `contest` asks the
processes in turn, one at a time; `report` and `chart` show what came out. One module a contestant or a family of them;
what they compute is in `formula`, on a `Grid` and for a `Case` of `case`. Never here: a peer imported unasked.
"""
