"""Whole plug-and-play, and its data step alone, by pnpct and by what its peers have for it.

All get the same scan (`write_scan`), begin from the same image (the one that pnpct begins from; its time counts), and
have the same denoiser, `n2n` with what pnpct puts around a network (`around_network`), and the same fall of sigma_v.
deepinv: its HQS with the statistical weights, which it has no option for, as part of the operator, and conjugate
gradients as its data step. svmbir: pnpct's own ADMM around the proximal map of svmbir.recon. Each answers with its time
and error after every iteration; what it takes to look at the error is not counted.

A data step is compared at the error after the fewest steps that pnpct takes, two preconditioned ones. How many plain
steps come as near is counted on pnpct's operator: deepinv has another discretisation, and so another solution. How many
passes svmbir takes is counted against its own solution.
"""

from collections.abc import Callable
from contextlib import suppress
from typing import Any

import numpy as np
import torch
from torch import Tensor

from contenders import Contender, Parts, World, deepinv_physics, imported_deepinv, svmbir_options
from pnpct.arrays import Image
from pnpct.denoisers.network_cost import network_cost
from pnpct.operators import Projector
from pnpct.physics import Sinogram
from pnpct.reconstruction import PlugAndPlay
from pnpct.reconstruction.around_network import around_network
from pnpct.reconstruction.normal_equations import INNER_ITERATIONS, Solve
from pnpct.reconstruction.pnp_admm import ADMMState, pnp_admm
from tasks import EXACT_STEPS, ITERATIONS, DataStep, Task, Watch

CG_STEPS = 10
"""Most steps of deepinv's conjugate gradients in each data step, from the last image on."""

ICD_PASSES = 3
"""Passes over the image of svmbir's coordinate descent in each data step, from the last image on."""


def pnpct(world: World, file: str, patience: float) -> Parts:
    del patience
    task = Task.read(world, file)
    step = DataStep.of(task)

    def run() -> dict[str, Any]:
        made = PlugAndPlay(task.denoise)(task.sinogram, task.projector)
        return {"errors": [task.error(made.image)], "iterations": made.iterations, "notes": list(made.notes)}

    return {
        "pnp": run,
        "data step": step.timed(lambda: step.solved(INNER_ITERATIONS, step.precondition), INNER_ITERATIONS),
        "data step, plain": step.timed(lambda: step.solved(step.plain_steps, None), step.plain_steps),
        "network": lambda: task.denoise(task.truth),
    }


def deepinv(world: World, file: str, patience: float) -> Parts:
    package = imported_deepinv()
    task, physics = Task.read(world, file), deepinv_physics(world)
    W, gamma = task.sinogram.weights.diagonal, torch.from_numpy(world.geometry("flat").fan_angles).float()
    # It sums over pixels, whatever the length of path in them; 1/σ of each ray makes the fit a weighted one.
    scale = _their_rays(W.sqrt() * task.projector.mu_water * world.spacing / gamma.cos())
    weighted = package.physics.LinearPhysics(
        A=lambda x, **_: scale * physics.A(x),
        A_adjoint=lambda y, **_: physics.A_adjoint(scale * y),
        max_iter=CG_STEPS,
        tol=1e-3,
    )
    y = _their_rays(W.sqrt() * task.sinogram.line_integrals)
    step = DataStep.of(task)
    beta, v = float(step.H.beta), _their_image(step.v)
    right = weighted.A_adjoint(y) + beta * v

    def solved() -> Image:
        apply = lambda x: weighted.A_adjoint(weighted.A(x)) + beta * x  # noqa: E731
        found = package.optim.linear.conjugate_gradient(apply, right, max_iter=step.plain_steps, tol=0.0, init=v)
        return _our_image(found)

    def run(network: Callable[[Image], Image], patience: float) -> dict[str, Any]:
        watch = Watch(task, patience)
        _, start, sigmas = task.begun()

        def denoise(x: Tensor, _sigma: object) -> Tensor:
            image = network(_our_image(x))
            if watch.look(image):
                raise EnoughError
            return _their_image(image)

        strengths = [float(sigma) for sigma, _ in zip(sigmas, range(ITERATIONS), strict=False)]
        model = package.optim.HQS(
            package.optim.L2(),
            package.optim.PnP(denoise),
            stepsize=[(sigma / 1000) ** 2 for sigma in strengths],
            sigma_denoiser=[sigma / 1000 for sigma in strengths],
            max_iter=ITERATIONS,
        )
        with torch.no_grad(), suppress(EnoughError):
            model(y, weighted, init=_their_image(start))
        return watch.record

    network = dncnn_of_like_size(task)
    return {
        "pnp": lambda: run(around_network(task.denoise, world.spacing), patience),
        "pnp, DnCNN": lambda: {**run(network, patience), "errors": []},
        "data step": lambda: {**step.timed(solved, step.plain_steps)(), "errors": []},
        "network": lambda: network(task.truth),
    }


class EnoughError(Exception):
    """Ends a loop of a peer that has no end of its own."""


def dncnn_of_like_size(task: Task) -> Callable[[Image], Image]:
    """Return an untrained DnCNN with about as many parameters as `n2n`, which is good for its time alone."""
    models = imported_deepinv().models
    aim = network_cost(task.denoise.network, 64, 64).parameters
    made = [models.DnCNN(1, 1, depth=depth, pretrained=None).eval() for depth in range(3, 12)]
    nearest = min(made, key=lambda network: abs(sum(each.numel() for each in network.parameters()) - aim))

    def denoise(image: Image) -> Image:
        with torch.no_grad():
            return nearest(image[None, None])[0, 0]

    return denoise


def _their_rays(rays: Tensor) -> Tensor:
    return rays.flip(-1).T[None, None].contiguous()


def _their_image(image: Image) -> Tensor:
    return torch.rot90(image)[None, None].contiguous()


def _our_image(image: Tensor) -> Image:
    return torch.rot90(image[0, 0], -1).contiguous()


def svmbir(world: World, file: str, patience: float) -> Parts:
    import svmbir as package

    task = Task.read(world, file)
    mu_water, fan = task.projector.mu_water, svmbir_options(world, "fan-flat")
    y, W = task.sinogram.line_integrals.numpy()[:, None], task.sinogram.weights.diagonal.numpy()[:, None]

    def theirs(image: Image) -> np.ndarray:
        return np.ascontiguousarray(mu_water * np.rot90(image.numpy().T, 2))[None]

    def proximal(v: Image, beta: float, x: Image, passes: int) -> Image:
        found = package.recon(
            y,
            world.angles,
            weights=W,
            prox_image=theirs(v),
            init_image=theirs(x),
            sigma_y=1.0,
            sigma_p=mu_water / beta**0.5,
            positivity=False,
            max_resolutions=0,
            max_iterations=passes,
            stop_threshold=0.0,
            num_rows=world.size,
            num_cols=world.size,
            **fan,
        )
        return torch.from_numpy(np.rot90(found[0], 2).T / mu_water).contiguous()

    def solver(sinogram: Sinogram, A: Projector) -> Solve:
        AtWy = A.T(sinogram.weights(sinogram.line_integrals))
        return lambda b, beta, x: proximal((b - AtWy) / beta, float(beta), x, ICD_PASSES)

    def run() -> dict[str, Any]:
        watch = Watch(task, patience)
        A, start, sigmas = task.begun()
        begun = ADMMState.start(start)
        denoise = around_network(task.denoise, world.spacing)
        for state in pnp_admm(task.sinogram, A, denoise, begun, sigma_v=sigmas, damping=0.5, solver=solver):
            if watch.look(state.v):
                return watch.record
        raise AssertionError("ADMM goes on for ever.")

    step = DataStep.of(task)
    after = lambda passes: proximal(step.v, float(step.H.beta), step.v, passes)  # noqa: E731
    exact = after(EXACT_STEPS)
    enough = next(n for n in range(1, EXACT_STEPS + 1) if step.error(after(n), exact) <= step.aim)
    return {"pnp": run, "data step": step.timed(lambda: after(enough), enough, exact)}


LOOPS = {
    "pnpct loop": Contender("pnpct", "pnpct", pnpct),
    "deepinv loop": Contender("deepinv", "deepinv", deepinv, "HQS; flat, its own discretisation", gigabytes=9.0),
    "svmbir loop": Contender("svmbir", "svmbir", svmbir, "its proximal map in pnpct's ADMM", gigabytes=4.0),
}
"""Plug-and-play with `n2n` by each package."""
