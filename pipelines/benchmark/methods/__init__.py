"""Methods of the benchmark that are not part of the package: custom components, as a user would write them.

Select one with ``feedforward._target_=pipelines.benchmark.methods.FILE.CLASS``.
"""
