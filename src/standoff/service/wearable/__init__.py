"""The reference receiver: shows, sounds, acknowledges, echoes, and says when nobody watches over its wearer."""

from standoff.service.wearable.device_clock import DeviceClock
from standoff.service.wearable.phrases import LANGUAGES, Phrases
from standoff.service.wearable.receiver import Level, Receiver, Shown, Signal

__all__ = ["LANGUAGES", "DeviceClock", "Level", "Phrases", "Receiver", "Shown", "Signal"]
