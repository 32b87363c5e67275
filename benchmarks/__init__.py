"""What the project costs in time, as ratios; apart from the tests, which assert no time. See docs/performance.md."""
