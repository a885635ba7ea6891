# SPDX-License-Identifier: GPL-3.0-or-later
"""What a second Blender runs that reads captures for the first one, with the path of a request as its last argument.

So neither importers nor the playing of actions touch anything of the artist's file, whatever they do, leave behind or
crash on.
"""

import os
import sys
from importlib import import_module
from pathlib import Path
from types import ModuleType

if __name__ == "__main__":
    # The extension's files without its interface and its core, for which this Blender has no use.
    package = ModuleType("oncue_captures")
    package.__path__ = [str(Path(__file__).resolve().parent)]
    sys.modules[package.__name__] = package
    import_module(f"{package.__name__}.bridge.imported_captures").answer(Path(sys.argv[-1]))
    sys.stdout.flush()
    # Some Blenders crash while they end; everything is written.
    os._exit(0)
