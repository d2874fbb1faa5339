#include "logic/graph_name.h"

namespace atom_rviz {

std::string graph_name(const std::string& name) {
  std::string valid = name;
  for (char& letter : valid) {
    const bool is_valid = (letter >= 'a' && letter <= 'z') || (letter >= 'A' && letter <= 'Z') ||
                          (letter >= '0' && letter <= '9') || letter == '_';
    if (!is_valid) letter = '_';
  }
  return valid;
}

}  // namespace atom_rviz
