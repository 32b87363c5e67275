"""Methods of the benchmark that the project does not ship: custom components, as any user would write them.

One file each, chosen by ``feedforward._target_=pipelines.benchmark.methods.FILE.CLASS``.
"""
