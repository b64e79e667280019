from pnpct.comparison.candidates import blurred, plug_and_play
from pnpct.denoisers import Gaussian, TotalVariation
from pnpct.reconstruction import DenoisedFBP, PlugAndPlay


def test_a_candidate_says_what_its_method_is():
    method = PlugAndPlay(TotalVariation(0.05), iterations=3)
    candidate = plug_and_play("pnp", "PnP", method)
    assert candidate.method.settings == method.settings
    assert (candidate.method.name, candidate.method.kind) == ("pnp", "plug-and-play")


def test_the_control_is_sharp_fbp_behind_a_blur():
    assert blurred(1.5).made_by == DenoisedFBP(Gaussian(1.5))
