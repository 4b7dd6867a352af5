"""The options that set a quality of service, and the profile that they give."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from helpers.ros2._commands import Parser

if TYPE_CHECKING:
    from rclpy.qos import QoSProfile

# The words of rclpy.qos, so that the options need no import of it.
PROFILES = (
    *('unknown', 'default', 'system_default', 'sensor_data', 'services_default', 'parameters'),
    *('parameter_events', 'action_status_default', 'best_available'),
)
POLICIES = {
    'history': ('system_default', 'keep_last', 'keep_all', 'unknown'),
    'reliability': ('system_default', 'reliable', 'best_effort', 'unknown', 'best_available'),
    'durability': ('system_default', 'transient_local', 'volatile', 'unknown', 'best_available'),
    'liveliness': ('system_default', 'automatic', 'manual_by_topic', 'unknown', 'best_available'),
}


def add_qos_arguments(parser: Parser, default: str) -> None:
    """Add the options, with the name of the profile that is meant without them."""
    help_ = f'Quality of service preset profile (default: {default})'
    parser.option('--qos-profile', help_, choices=PROFILES, default=default)
    parser.option('--qos-depth', 'Queue size setting', metavar='N', type=int)
    for policy, words in POLICIES.items():
        parser.option(f'--qos-{policy}', f'Quality of service {policy} setting', choices=words)
    parser.option('--qos-liveliness-lease-duration-seconds', 'Lease of the liveliness', type=float)


def is_set(args: argparse.Namespace) -> bool:
    """Whether a user has set a policy, not only a profile."""
    policies = [name for name in vars(args) if name.startswith('qos_') and name != 'qos_profile']
    return any(getattr(args, name) is not None for name in policies)


def profile(args: argparse.Namespace) -> QoSProfile:
    """Return the profile that the options give."""
    from rclpy import qos
    from rclpy.duration import Duration

    chosen = qos.QoSPresetProfiles.get_from_short_key(args.qos_profile)
    for policy in POLICIES:
        if word := getattr(args, f'qos_{policy}'):
            kind = getattr(qos, f'QoS{policy.title()}Policy')
            setattr(chosen, policy, kind.get_from_short_key(word))
    if (lease_s := args.qos_liveliness_lease_duration_seconds) and lease_s >= 0:
        chosen.liveliness_lease_duration = Duration(seconds=lease_s)
    if args.qos_depth and args.qos_depth >= 0:
        chosen.depth = args.qos_depth
    elif chosen.durability == qos.QoSDurabilityPolicy.TRANSIENT_LOCAL and chosen.depth == 0:
        chosen.depth = 1
    return chosen
