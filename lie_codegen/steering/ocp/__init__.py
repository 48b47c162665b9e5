"""Open optimal control on any group: own costs, constraints and parameters, solved by one bounded solver in C."""
