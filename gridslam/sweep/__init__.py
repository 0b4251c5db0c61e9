"""Many runs: logs and worlds x configs x overrides x seeds, measured, in one table."""
