"""What a person asks of a node, by a service or a menu: done one at a time, and answered."""

from __future__ import annotations

import threading
from typing import Callable, Optional, Tuple

import rospy
from std_srvs.srv import Trigger, TriggerResponse

from atom_core.errors import AtomError

Action = Callable[[], str]


class Actions:
    """Does what is asked for; an action returns what to tell the person, and so does its refusal.

    Attributes:
        lock: held while something is done; whoever changes the same from elsewhere takes it too.
    """

    def __init__(
        self, tell: Callable[[str], None], answered: Optional[Callable[[str, bool], None]] = None
    ):
        """Begin.

        Args:
            tell: shows in RViz what came of an entry of a menu.
            answered: is told every answer, and whether it was done.
        """
        self._answered = answered
        self.lock = threading.RLock()  # feedback, services and menus come in different threads
        self._tell = tell

    def do(self, action: Action) -> TriggerResponse:
        """Do something, and log what came of it."""
        with self.lock:
            try:
                answer = TriggerResponse(True, action())
            except AtomError as error:
                answer = TriggerResponse(False, str(error))
        if self._answered is not None:
            self._answered(answer.message, answer.success)
        (rospy.loginfo if answer.success else rospy.logerr)(answer.message)
        return answer

    def serve(self, name: str, action: Action) -> None:
        """Advertise an action as a service below the node's name."""
        rospy.Service(f"~{name}", Trigger, lambda _: self.do(action))

    def entry(self, title: str, action: Action) -> Tuple[str, Callable[[], None]]:
        """Return an action as an entry of a menu."""
        return title, lambda: self._tell(self.do(action).message)
