#include "berth/mqtt/names.hpp"

#include <arpa/inet.h>
#include <netdb.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include <array>
#include <atomic>
#include <system_error>
#include <thread>
#include <utility>

#include "berth/mqtt/where.hpp"

namespace berth::mqtt {
namespace {

void add(std::vector<std::string>& addresses, const addrinfo& found) {
  std::array<char, NI_MAXHOST> text{};
  if (::getnameinfo(found.ai_addr, found.ai_addrlen, text.data(), text.size(), nullptr, 0, NI_NUMERICHOST) == 0)
    addresses.emplace_back(text.data());
}

Addresses look_up(const std::string& host) {
  addrinfo hints{};
  hints.ai_family = AF_UNSPEC;
  hints.ai_socktype = SOCK_STREAM;
  addrinfo* list = nullptr;
  const int error = ::getaddrinfo(host.c_str(), nullptr, &hints, &list);
  if (error != 0) return tl::unexpected(error);
  std::vector<std::string> addresses;
  for (const addrinfo* found = list; found != nullptr; found = found->ai_next) add(addresses, *found);
  ::freeaddrinfo(list);
  if (addresses.empty()) return tl::unexpected(EAI_NONAME);
  return addresses;
}

}  // namespace

struct Names::Lookup {
  std::atomic<bool> done{false};
  Addresses answer = tl::unexpected(EAI_SYSTEM);  // belongs to the thread until `done`
};

std::shared_ptr<Names::Lookup> Names::begin(const std::string& host) const {
  auto lookup = std::make_shared<Lookup>();
  try {
    std::thread([lookup, host, bell = bell_] {
      lookup->answer = look_up(host);
      lookup->done.store(true, std::memory_order_release);
      bell->ring();
    }).detach();
  } catch (const std::system_error&) {  // no thread: it counts as a failed lookup
    lookup->done.store(true, std::memory_order_release);
    bell_->ring();
  }
  return lookup;
}

std::optional<Addresses> Names::ask(const std::string& host, Time now) {
  if (is_address(host)) return Addresses(std::vector{host});
  auto& known = known_[host];
  const bool failed = known.told && !known.lookup->answer;
  if (!known.lookup || (known.told && (failed ? now > *known.told : now >= *known.told + fresh))) {
    known = {begin(host), {}};
    return std::nullopt;
  }
  if (!known.lookup->done.load(std::memory_order_acquire)) return std::nullopt;
  if (!known.told) known.told = now;
  return known.lookup->answer;
}

}  // namespace berth::mqtt
