"""lie_codegen: from a Lie algebra to fast C.

The names below are the front door; each is imported when first used, so that calling compiled functions
imports neither SymPy nor CasADi.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

__version__ = "0.1.0"

_FRONT_DOOR = {
    "group": "lie_codegen.groups.catalogue_load",
    "group_names": "lie_codegen.groups.catalogue_names",
    "from_matrices": "lie_codegen.groups.definition",
    "from_brackets": "lie_codegen.groups.definition",
    "MatrixGroup": "lie_codegen.groups.matrix_group",
    "product": "lie_codegen.groups.products",
    "semidirect": "lie_codegen.groups.products",
    "pauli": "lie_codegen.groups.pauli",
    "change_of_basis": "lie_codegen.groups.change_of_basis",
    "structure": "lie_codegen.groups.structure",
    "wei_norman": "lie_codegen.groups.wei_norman.matrix",
    "wei_norman_order": "lie_codegen.groups.wei_norman.order",
    "cartan_involution": "lie_codegen.groups.cartan",
    "chart_domain": "lie_codegen.groups.wei_norman.chart_domain",
    "controllability": "lie_codegen.groups.controllability",
    "tangent_to": "lie_codegen.groups.conventions",
    "tangent_from": "lie_codegen.groups.conventions",
    "rotation_from_quaternion": "lie_codegen.groups.conventions",
    "quaternion_from_rotation": "lie_codegen.groups.conventions",
    "mean": "lie_codegen.groups.maps.barycentre",
    "interpolate": "lie_codegen.groups.maps.barycentre",
    "Uncertain": "lie_codegen.groups.maps.uncertain",
    "fuse": "lie_codegen.groups.maps.uncertain",
    "covariance_kernels": "lie_codegen.groups.maps.covariance_kernels",
    "PeriodicInput": "lie_codegen.signals.periodic_input",
    "SampledInput": "lie_codegen.signals.sampled_input",
    "average": "lie_codegen.averaging.averaged",
    "order_check": "lie_codegen.averaging.order_check",
    "Kernel": "lie_codegen.kernel.kernel",
    "Port": "lie_codegen.kernel.kernel",
    "kernel_factory": "lie_codegen.kernel.definition",
    "group_kernels": "lie_codegen.groups.kernels",
    "nearest": "lie_codegen.groups.maps.nearest",
    "build": "lie_codegen.groups.build",
    "generate": "lie_codegen.groups.build",
    "simulate": "lie_codegen.flow.simulate",
    "Event": "lie_codegen.flow.events",
    "steer": "lie_codegen.steering.front",
    "Pointing": "lie_codegen.steering.goals",
    "Position": "lie_codegen.steering.goals",
    "Coset": "lie_codegen.steering.goals",
    "UpToPhase": "lie_codegen.steering.goals",
    "qutip_evolution": "lie_codegen.steering.qutip_export",
    "ocp": "lie_codegen.steering.ocp.front",
    "mpc": "lie_codegen.steering.ocp.mpc",
    "Cone": "lie_codegen.steering.constraints",
    "Ball": "lie_codegen.steering.constraints",
    "plot_plan": "lie_codegen.pictures.plot_plan",
    "attitude_law": "lie_codegen.control.attitude_law",
    "tracking_law": "lie_codegen.control.tracking_law",
    "integral_law": "lie_codegen.control.integral_law",
    "error_function": "lie_codegen.control.error_function",
    "reference": "lie_codegen.control.reference_kernels",
    "closed_loop": "lie_codegen.control.closed_loop",
    "generate_closed_loop": "lie_codegen.control.closed_loop_package",
    "elliptic_kernels": "lie_codegen.rigid_body.elliptic_kernels",
    "free_rigid_body": "lie_codegen.rigid_body.free_rigid_body",
    "euler_average": "lie_codegen.rigid_body.euler_average",
    "lagrangian_system": "lie_codegen.mechanics.lagrangian",
    "routh_reduce": "lie_codegen.mechanics.routh",
    "vibrational_average": "lie_codegen.mechanics.vibrational_average",
}

__all__ = ["__version__", "errors", *_FRONT_DOOR]


def __getattr__(name: str) -> Any:
    if name == "errors":
        return import_module("lie_codegen.errors")
    if name not in _FRONT_DOOR:
        raise AttributeError(f"module 'lie_codegen' has no attribute {name!r}")
    value = getattr(import_module(_FRONT_DOOR[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
