"""Events of a walk: feet strike, stick, slide and leave, the operator's hands, falls (EQUATIONS 8, 9, 15, 16)."""
