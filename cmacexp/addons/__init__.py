"""Add-ons: products of their own on the core's names; the core imports none of them, and none another."""
