#include "logic/presence.h"

namespace atom_rviz {
namespace {

bool is_offered(const std::string& service, const std::map<std::string, bool>& offered) {
  const auto found = offered.find(service);
  return found != offered.end() && found->second;
}

}  // namespace

std::string first_service(const std::string& node) { return node + "get_loggers"; }

Presence presence_of(const std::string& node, const std::string& service,
                     const std::map<std::string, bool>& offered) {
  if (is_offered(service, offered)) return Presence::kRunning;
  return is_offered(first_service(node), offered) ? Presence::kStarting : Presence::kAbsent;
}

}  // namespace atom_rviz
