"""SLAM in semi-dynamic environments: a Rao-Blackwellised particle filter over grid maps."""
