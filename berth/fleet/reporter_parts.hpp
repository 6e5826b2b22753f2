/// A host's command under way. Internal to room `fleet`.
#pragma once

#include <string>
#include <utility>

#include "berth/command/audit.hpp"
#include "berth/fleet/reporter.hpp"

namespace berth::fleet {

struct Reporter::Work {
  Work(sparkplug::Command what, command::Request asked, tree::Session& session, const std::string& who)
      : command(std::move(what)), request(std::move(asked)), audit(session, who, request), scope(session.executor()) {}
  sparkplug::Command command;
  command::Request request;
  command::Audit audit;
  command::Reply reply{};
  bool done = false;
  rt::Scope scope;  // last: its task uses the other members
};

}  // namespace berth::fleet
