"""Numbers and disk: scans, images and their provenance, and what other programs have written.

`__init__.pyi` lists the names; the module of each is imported when it is first asked for, so that nobody waits for
libraries of file formats that they do not use.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
