"""Methods of the benchmark that the project does not ship: custom components, as any user would write them.

Chosen by ``feedforward._target_=pipelines.benchmark.methods.FILE.CLASS``.
"""
