# SPDX-License-Identifier: GPL-3.0-or-later
"""The buttons. Each is thin: the work is a plain function elsewhere, so a script can do what a button does."""
