"""Localization in a space with cameras of its own."""
