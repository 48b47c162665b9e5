"""Vehicles and bodies: quadrotor, underwater vehicle, sphere, manipulator, actuator allocation."""
