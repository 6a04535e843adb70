"""What was decided for a vehicle and what it brought: kept for good, and judged on the flights that came after."""
