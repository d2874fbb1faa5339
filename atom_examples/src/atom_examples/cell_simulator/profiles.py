"""Names of the profiles of systematic errors, here since a command line shall not load MuJoCo."""

PLAIN_PROFILE, ROUGH_PROFILE = "plain", "rough"
