"""When the daemon lives: started, bound, or both (android.app.Service)."""

from collections.abc import Hashable


class Lifecycle:
    """A started daemon stays; one that is only bound ends with its last auto_create binding."""

    def __init__(self, started: bool) -> None:
        self.started = started
        self._bound: dict[Hashable, bool] = {}
        self._ended = False
        self._was_bound = False
        self._was_told = False

    @property
    def bound_clients(self) -> int:
        """Bindings in all."""
        return len(self._bound)

    @property
    def keeping_clients(self) -> int:
        """Bindings with auto_create: those that keep the daemon alive."""
        return sum(self._bound.values())

    @property
    def awaits_first_bind(self) -> bool:
        """True for a daemon that was started for a client which has not bound yet."""
        return not self.started and not self._was_bound and not self._ended

    @property
    def over(self) -> bool:
        """True once the daemon must end."""
        return self._ended or (not self.started and self._was_bound and not self.keeping_clients)

    @property
    def reason(self) -> str:
        """Why the daemon ends."""
        if self._was_told:
            return "it was told to stop"
        return "its last client unbound" if self._was_bound else "no client bound"

    def start(self) -> None:
        """Note that the daemon was asked to stay."""
        self.started = True
        self._was_told = False

    def stop(self) -> None:
        """Note that it was asked to go: it ends when no auto_create binding is left."""
        self.started = False
        self._was_bound = self._was_told = True

    def end(self) -> None:
        """End at once, whoever is bound."""
        self._ended = self._was_told = True

    def bind(self, client: Hashable, auto_create: bool) -> None:
        """Note a binding; a second one of the same client replaces the first."""
        self._bound[client] = auto_create
        self._was_bound = self._was_bound or auto_create

    def unbind(self, client: Hashable) -> None:
        """Undo `bind`; an unknown client is left alone."""
        self._bound.pop(client, None)
