"""Steering by torques alone: oscillations whose symmetric products push where no torque does."""
