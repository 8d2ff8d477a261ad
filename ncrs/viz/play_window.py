"""The window to play in, which turns keys and clicks into a session's actions."""

from __future__ import annotations

import os
from typing import Any

from ncrs.automaton.torch_settings import one_torch_thread
from ncrs.viz.errors import VizError
from ncrs.viz.play_session import PlaySession
from ncrs.viz.play_view import draw_play, layout_of
from ncrs_envs.body import Cell
from ncrs_envs.physics import DT

FPS = 25
_UNSEEN_DRIVERS = ("dummy", "offscreen", "evdev")
_DRIVER_VARIABLE = "SDL_VIDEODRIVER"
SPEEDS = (0.125, 0.25, 0.5, 1.0)
DEFAULT_SPEED = 0.25
_MAX_STEPS_PER_FRAME = 5
"""Maximum number of steps between two frames: a slow computer plays in slow motion, no jumps."""


class PlayWindow:
    """A window on a session; a context manager.

    Args:
        session: Session to play.
        title: Title above the evolved robot.

    Raises:
        VizError: If there is no screen.
    """

    def __init__(self, session: PlaySession, title: str = "evolved") -> None:
        os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
        import pygame

        self._pygame: Any = pygame
        self._session = session
        self._title = title
        self._layout = layout_of(session)
        self._keys: set[int] = set()
        self._owed = 0.0
        self.speed = DEFAULT_SPEED
        self.chosen = Cell.WHEEL
        """Cell type that a click puts into the body."""
        self.open = True
        try:
            pygame.display.init()
            pygame.display.set_caption("ncrs play")
            driver = pygame.display.get_driver()
            # Without a screen SDL takes one of these by itself, and nobody could close the window.
            if driver in _UNSEEN_DRIVERS and _DRIVER_VARIABLE not in os.environ:
                pygame.display.quit()
                raise pygame.error(f"only the {driver} driver works")
            self._screen = pygame.display.set_mode(self._layout.size)
        except pygame.error as error:
            raise VizError(
                f"There is no screen to open a window on ({error}); ncrs film needs none."
            ) from error
        self._clock = pygame.time.Clock()

    def __enter__(self) -> PlayWindow:
        return self

    def __exit__(self, *_: object) -> None:
        self._session.close()
        self._pygame.display.quit()

    def run(self) -> None:
        """Play until the window is closed."""
        with one_torch_thread():
            elapsed = 0.0
            while self.open:
                self.frame(elapsed)
                elapsed = self._clock.tick(FPS) / 1000.0

    def frame(self, elapsed: float) -> None:
        """Handle events, advance by ``elapsed`` seconds of real time, and draw."""
        for event in self._pygame.event.get():
            self._handle(event)
        if not self.open:
            return
        self._owed += elapsed * self.speed / DT
        steps = min(int(self._owed), _MAX_STEPS_PER_FRAME)
        self._owed = min(self._owed - steps, 1.0)
        for _ in range(steps):
            self._session.step(*self._drive())
        picture = draw_play(self._session, self.chosen, self.speed, self._title)
        self._pygame.surfarray.blit_array(self._screen, picture.transpose(1, 0, 2))
        self._pygame.display.flip()

    def _drive(self) -> tuple[float, float]:
        """Compute throttle and turn from the keys held down."""
        pygame = self._pygame

        def held(*keys: int) -> float:
            return float(any(key in self._keys for key in keys))

        throttle = held(pygame.K_UP, pygame.K_w) - held(pygame.K_DOWN, pygame.K_s)
        turn = held(pygame.K_LEFT, pygame.K_a) - held(pygame.K_RIGHT, pygame.K_d)
        return throttle, turn

    def _handle(self, event: Any) -> None:
        pygame = self._pygame
        if event.type == pygame.QUIT:
            self.open = False
        elif event.type == pygame.KEYDOWN:
            self._keys.add(event.key)
            self._press(event.key)
        elif event.type == pygame.KEYUP:
            self._keys.discard(event.key)
        elif event.type == pygame.WINDOWFOCUSLOST:
            self._keys.clear()  # their release will go unnoticed
        elif event.type == pygame.MOUSEBUTTONDOWN:
            self._click(event.pos, event.button)

    def _press(self, key: int) -> None:
        pygame, session = self._pygame, self._session
        if key == pygame.K_ESCAPE:
            self.open = False
        elif key == pygame.K_r:
            session.restart()
        elif key == pygame.K_n:
            session.next_scenario()
        elif key == pygame.K_b and session.rival_body is not None:
            session.wear(session.rival_body)
        elif key in (pygame.K_PLUS, pygame.K_EQUALS, pygame.K_KP_PLUS):
            self.speed = SPEEDS[min(SPEEDS.index(self.speed) + 1, len(SPEEDS) - 1)]
        elif key in (pygame.K_MINUS, pygame.K_KP_MINUS):
            self.speed = SPEEDS[max(SPEEDS.index(self.speed) - 1, 0)]
        else:
            codes = {pygame.K_0 + int(cell): cell for cell in session.cells}
            self.chosen = codes.get(key, self.chosen)

    def _click(self, position: tuple[int, int], button: int) -> None:
        cell = self._layout.palette_at(*position)
        if cell is not None:
            self.chosen = cell
            return
        place = self._layout.cell_at(*position)
        if place is not None and button in (1, 3):
            self._session.paint(*place, self.chosen if button == 1 else Cell.EMPTY)
