"""The filter of the terrain alone, which the estimators until v1.15 have beside the main one."""
