// Preloaded into RViz: writes the clock's time and the process's own at the end of each frame, two
// doubles in seconds, to the file $ATOM_FRAMES. It wraps the one function of Ogre that RViz calls
// for a frame, so that a frame is counted when it has been drawn, not when a timer asked for it.
#include <dlfcn.h>

#include <cstdio>
#include <cstdlib>
#include <ctime>

namespace {

using Render = bool (*)(void*);

double seconds(clockid_t clock) {
  timespec now;
  clock_gettime(clock, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

FILE* frames_file() {
  const char* path = std::getenv("ATOM_FRAMES");
  return path ? std::fopen(path, "wb") : nullptr;
}

}  // namespace

// bool Ogre::Root::renderOneFrame()
extern "C" bool _ZN4Ogre4Root14renderOneFrameEv(void* root) {
  static const auto original =
      reinterpret_cast<Render>(dlsym(RTLD_NEXT, "_ZN4Ogre4Root14renderOneFrameEv"));
  static FILE* const file = frames_file();
  const bool result = original(root);
  if (file) {
    const double times[] = {seconds(CLOCK_MONOTONIC), seconds(CLOCK_PROCESS_CPUTIME_ID)};
    std::fwrite(times, sizeof(double), 2, file);
    std::fflush(file);
  }
  return result;
}
