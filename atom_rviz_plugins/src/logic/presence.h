// Whether a node runs, by the services that the master knows.
#pragma once

#include <map>
#include <string>

namespace atom_rviz {

enum class Presence {
  kAbsent,
  kStarting,  ///< it is there, and does not serve yet: it waits for what it needs
  kRunning
};

/// The service that every node of Python offers as soon as it is there.
std::string first_service(const std::string& node);

/// Whether a node, a namespace such as "/collect_data/", runs.
///
/// `offered` tells of services whether somebody offers them; the node runs where `service` is.
Presence presence_of(const std::string& node, const std::string& service,
                     const std::map<std::string, bool>& offered);

}  // namespace atom_rviz
