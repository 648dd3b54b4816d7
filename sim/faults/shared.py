"""Things that are made once for all threads that ask for them."""

from collections.abc import Callable, Hashable
from concurrent.futures import Future
from threading import Lock
from typing import Generic, TypeVar

Key = TypeVar("Key", bound=Hashable)
Value = TypeVar("Value")


class Shared(Generic[Key, Value]):
    """The last `kept` things by key. Who asks for one that is being made waits for it; functools' caches make two."""

    def __init__(self, kept: int) -> None:
        self._kept, self._lock = kept, Lock()
        self._things: dict[Key, Future[Value]] = {}

    def get(self, key: Key, make: Callable[[], Value]) -> Value:
        """The thing of that key, made if need be. What make raises goes to all who wait, and is not kept."""
        with self._lock:
            known = self._things.get(key)
            thing: Future[Value] = known or Future()
            if known is None:
                self._things[key] = thing
                while len(self._things) > self._kept:
                    del self._things[next(iter(self._things))]
        if known is None:
            try:
                thing.set_result(make())
            except BaseException as error:
                with self._lock:
                    if self._things.get(key) is thing:
                        del self._things[key]
                thing.set_exception(error)
        return thing.result()
