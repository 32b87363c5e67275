# One list of checks, that of CI.
.PHONY: check
check:
	.ci/run
