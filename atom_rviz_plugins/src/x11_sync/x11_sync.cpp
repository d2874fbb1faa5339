// Preloaded into RViz (LD_PRELOAD), so that it does not die while it starts.
//
// RViz's renderer, Ogre, creates each window on one connection to the X server and draws into it on
// another one, and nothing makes the server take the two in this order. When the server is late it
// may be asked for the size of a window that it does not know yet. Mesa's software renderer does
// not notice that the answer is an error: it takes for the size what happens to stand in its
// memory, mostly a height of zero, allocates a depth buffer of no bytes, and writes into it.
//
// Synchronous connections mend it: Xlib then returns from each request only after the server has
// carried it out. Frames are no slower for it: the software renderer waits for the server with each
// of them anyway, and a graphics card's driver does not send them through Xlib.
#include <X11/Xlib.h>

namespace {

/// Make all connections synchronous that Xlib opens from now on; runs before `main`.
__attribute__((constructor)) void make_connections_synchronous() { _Xdebug = 1; }

}  // namespace
