// Preloaded into RViz, too: where the launch file asks for it (ATOM_ENDS_LAUNCH), the launch ends
// as after Ctrl-C when the window was closed.
//
// roslaunch knows it as the death of a required process otherwise, and says so in red. An RViz that
// fails does not come here, or not with success, and is called dead as before.
#include <signal.h>
#include <stdlib.h>
#include <unistd.h>

#include <fstream>
#include <string>

namespace {

constexpr unsigned kRoslaunchLooks_us = 700000;  // it does ten times a second

/// Tell whether a process is roslaunch; its name is one of the first words, behind Python's.
bool is_roslaunch(pid_t process) {
  std::ifstream words("/proc/" + std::to_string(process) + "/cmdline");
  std::string word;
  for (int i = 0; i < 3 && std::getline(words, word, '\0'); ++i) {
    if (word.substr(word.rfind('/') + 1) == "roslaunch") return true;
  }
  return false;
}

void end_launch(int code, void*) {
  const pid_t parent = getppid();
  if (code != 0 || !is_roslaunch(parent)) return;
  // Where roslaunch itself has ended RViz, this changes nothing: it does not listen a second time.
  if (kill(parent, SIGINT) == 0) usleep(kRoslaunchLooks_us);
}

/// Runs before `main`.
__attribute__((constructor)) void end_launch_when_done() {
  if (getenv("ATOM_ENDS_LAUNCH") != nullptr) on_exit(end_launch, nullptr);
}

}  // namespace
