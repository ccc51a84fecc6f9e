"""The laboratory of sigmaik: studies of methods, limits, motions and arms, which `sigmaik NAME` runs.

A study is one folder of this package: `sigmaik --help` finds the folder and shows the first line of its docstring, and
`sigmaik NAME` runs its `study.py` (see `sigmaik_lab.study.Study`). A folder `sigmaik_lab/NAME` anywhere on Python's
path is a study too. Applications import `sigmaik`, which knows nothing of this package.
"""

from pkgutil import extend_path

__path__ = extend_path(__path__, __name__)
