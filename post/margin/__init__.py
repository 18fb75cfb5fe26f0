"""The picture that sweeps read: what lies past its border, continued."""
