"""Localization and mapping in a space with cameras of its own."""
