// Clients that do whatever they like, from seeds: bytes that are no HTTP, requests that are cut, changed or sent many
// at once, frames of a WebSocket that break its rules, files that never end, connections that close at any time.
// Whatever they do, one that behaves is served, and with the token of role view nothing is changed.
#include <algorithm>
#include <array>

#include "../pch.hpp"
#include "berth/base/random.hpp"
#include "server_fixture.hpp"

namespace berth::studio {
namespace {

class StudioMisbehaving : public StudioServer {
 protected:
  std::uint64_t up_to(std::uint64_t most) { return random_.below(most + 1); }
  std::string any_bytes(std::size_t most) {
    std::string bytes(up_to(most), '\0');
    for (auto& byte : bytes) byte = static_cast<char>(up_to(255));
    return bytes;
  }
  std::string changed(std::string text) {
    for (auto times = up_to(4); times > 0 && !text.empty(); --times) {
      const auto at = up_to(text.size() - 1);
      switch (up_to(3)) {
        case 0: text[at] = static_cast<char>(up_to(255)); break;
        case 1: text.erase(at, up_to(20)); break;
        case 2: text.insert(at, text.substr(up_to(text.size() - 1), up_to(40))); break;
        default: text.resize(at); break;
      }
    }
    return text;
  }
  std::string viewer() const { return "Authorization: Bearer " + token(command::Role::view) + "\r\n"; }
  std::string posted(const std::string& path, const std::string& body, std::size_t length) const {
    return head("POST " + path, viewer() + fmt::format("Origin: http://{}\r\nContent-Length: {}\r\n", own(), length)) +
           body;
  }
  std::string a_request() {
    const std::string body = a_message(), command = R"({"verb":"nmt","arguments":{"command":"start"}})";
    switch (up_to(6)) {
      case 0: return head("GET /");
      case 1: return head("GET /api/v1/snapshot", viewer());
      case 2: return posted("/api/v1/request", command, command.size());
      case 3: return posted("/api/v1/request", body, body.size());
      case 4: return head("GET /api/v1/trace?format=asc&filter=705", viewer());
      case 5: return posted("/api/v1/read?name=a.log", any_bytes(300), up_to(100'000));
      default: return socket(token(command::Role::view), "http://" + own());
    }
  }
  std::string a_message() {
    static constexpr std::array messages{
        R"({"type":"request","id":"a","verb":"nmt","arguments":{"command":"start","yes":"1"}})",
        R"({"type":"request","id":"b","verb":"report"})",
        R"({"type":"request","id":"c","verb":"sim","arguments":{"action":"unplug"}})",
        R"({"type":"frames","id":"f","count":2000,"filter":"705"})",
        R"({"type":"live","frames":true})",
        R"({"type":"unlock","minutes":480})",
        R"({"type":"lock"})",
    };
    return messages[up_to(messages.size() - 1)];
  }
  /// A frame of a WebSocket: mostly one that is allowed.
  std::string a_frame() {
    const bool good = up_to(2) > 0;
    const std::string text = up_to(3) == 0 ? changed(a_message()) : a_message();
    std::string frame{static_cast<char>(good ? 0x81 : up_to(255))};
    const auto told = good ? text.size() : up_to(200);
    frame += static_cast<char>((good ? 0x80U : up_to(1) << 7U) | std::min<std::uint64_t>(told, 126));
    if (told >= 126) frame += {'\0', static_cast<char>(told)};
    return frame + std::string(4, '\0') + text;
  }
  std::string whatever() {
    switch (up_to(4)) {
      case 0: return any_bytes(2000);
      case 1: return changed(a_request());
      case 2: return a_frame();
      case 3: return a_request() + a_request() + a_request();
      default: return a_request();
    }
  }
  void misbehave(unsigned steps) {
    std::vector<std::unique_ptr<Connection>> clients;
    for (unsigned i = 0; i < steps; ++i) {
      if (clients.size() < 20 && up_to(2) == 0) clients.push_back(connect());
      if (clients.empty()) continue;
      const auto at = up_to(clients.size() - 1);
      switch (up_to(5)) {
        case 0: clients.erase(clients.begin() + static_cast<std::ptrdiff_t>(at)); break;
        case 1: clients[at]->hear(); break;
        default: clients[at]->say(whatever()); break;
      }
      frames(static_cast<unsigned>(up_to(20)));
      loop_.turn(1ms);
    }
  }
  Random random_{1};
};

}  // namespace

TEST_F(StudioMisbehaving, WhoeverBehavesIsServedAndRoleViewChangesNothing) {
  for (std::uint64_t seed = 1; seed <= 25; ++seed) {
    SCOPED_TRACE(fmt::format("seed {}", seed));
    random_ = Random(seed);
    session_->set_careful(seed % 2 == 0);
    misbehave(120);
    EXPECT_EQ(changed_, 0U);
    // The server may not have seen yet that the others closed their connections.
    bool room = false;
    for (int i = 0; i < 1000 && !room; ++i) room = status_of(head("GET /")) == "HTTP/1.1 200";
    ASSERT_TRUE(room);
    auto client = page();
    ASSERT_EQ(snapshot_["role"], "configure");
    EXPECT_EQ(snapshot_["lock"]["unlocked_until_s"], nullptr);
    client->send(R"({"type":"request","id":"good","verb":"report"})");
    ASSERT_EQ(client->next("reply")["id"], "good");
  }
}

}  // namespace berth::studio
