"""Where the checkout and the scripts that tests start as processes of their own lie."""

from __future__ import annotations

from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
SUPPORT = ROOT / "test" / "support"
SCRIPT_PATH = f"{ROOT}:{ROOT / 'test'}"  # PYTHONPATH of a script of SUPPORT
