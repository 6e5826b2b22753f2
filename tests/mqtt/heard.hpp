/// A handler that keeps what it was told, and lets the test wait for it.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <functional>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "berth/mqtt/client.hpp"
#include "broker.hpp"

namespace berth::mqtt::test {

struct Arrived {
  std::string topic;
  std::string payload;
  bool retained = false;
};

/// All that a client has told, in its order.
struct Story {
  std::vector<std::string> order{};  ///< "connecting", "connected", "message TOPIC", "published 1", ...
  std::vector<Connected> connected{};
  std::vector<Disconnected> disconnected{};
  std::vector<Arrived> messages{};
  std::vector<MessageId> published{};
  std::map<MessageId, std::string> unpublished{};
  [[nodiscard]] bool is_connected() const { return connected.size() > lost(); }
  [[nodiscard]] std::size_t lost() const {
    return static_cast<std::size_t>(std::ranges::count(disconnected, true, &Disconnected::was_connected));
  }
  [[nodiscard]] bool has(const std::string& topic) const {
    return std::ranges::find(messages, topic, &Arrived::topic) != messages.end();
  }
};

class Heard : public Handler {
 public:
  virtual ~Heard() = default;

  std::optional<Will> connecting() noexcept override {
    const std::lock_guard lock(mutex_);
    story_.order.emplace_back("connecting");
    return next_will ? next_will(story_) : std::nullopt;
  }
  void connected(const Connected& told) noexcept override {
    tell([&](Story& s) {
      s.order.emplace_back("connected");
      s.connected.push_back(told);
    });
  }
  void disconnected(const Disconnected& told) noexcept override {
    tell([&](Story& s) {
      s.order.emplace_back("disconnected");
      s.disconnected.push_back(told);
    });
  }
  void message(std::string_view topic, std::span<const std::uint8_t> payload, bool retained) noexcept override {
    tell([&](Story& s) {
      s.order.push_back("message " + std::string(topic));
      s.messages.push_back({std::string(topic), {payload.begin(), payload.end()}, retained});
    });
  }
  void published(MessageId id) noexcept override {
    tell([&](Story& s) {
      s.order.push_back("published " + std::to_string(id));
      s.published.push_back(id);
    });
  }
  void unpublished(MessageId id, std::string_view why) noexcept override {
    tell([&](Story& s) {
      s.order.push_back("unpublished " + std::to_string(id));
      s.unpublished[id] = why;
    });
  }

  /// Waits until it is so.
  [[nodiscard]] testing::AssertionResult until(const std::function<bool(const Story&)>& so) const {
    std::unique_lock lock(mutex_);
    if (changed_.wait_for(lock, patience, [&] { return so(story_); })) return testing::AssertionSuccess();
    auto failure = testing::AssertionFailure() << "it did not come; what came:";
    for (const auto& event : story_.order) failure << "\n  " << event;
    for (const auto& event : story_.disconnected) failure << "\n  disconnected: " << event.words;
    return failure;
  }
  [[nodiscard]] Story story() const {
    const std::lock_guard lock(mutex_);
    return story_;
  }
  /// The number of the present connection.
  [[nodiscard]] ConnectionNumber number() const {
    const auto now = story();
    return now.connected.empty() ? 0 : now.connected.back().connection;
  }

  std::function<std::optional<Will>(const Story&)> next_will{};  ///< set before the client starts

 private:
  void tell(const std::function<void(Story&)>& what) {
    const std::lock_guard lock(mutex_);
    what(story_);
    changed_.notify_all();
  }
  mutable std::mutex mutex_;
  mutable std::condition_variable changed_;
  Story story_;
};

inline bool is_up(const Story& story) { return story.is_connected(); }

/// Quick, for tests: its pauses are short.
inline Options quick(const Where& where, const std::string& client_id, Version version = Version::automatic) {
  Options options{.where = where, .client_id = client_id, .version = version};
  options.pauses = {.first = Milliseconds(20), .longest = Milliseconds(200), .good_after = Milliseconds(0)};
  return options;
}

inline std::vector<std::uint8_t> bytes(std::string_view text) { return {text.begin(), text.end()}; }

inline std::unique_ptr<Thread> thread() { return Thread::start().value(); }

/// A client and what it told, on a thread of its own unless one is given.
class Station {
 public:
  explicit Station(Options options, std::function<std::optional<Will>(const Story&)> will = {},
                   Thread* shared = nullptr) {
    if (shared == nullptr) own_ = thread();
    heard.next_will = std::move(will);
    auto started = Client::start(shared == nullptr ? *own_ : *shared, std::move(options), Random(7), heard);
    EXPECT_TRUE(started.has_value()) << started.error();
    if (started) client = std::move(*started);
  }
  Station(const Station&) = delete;
  Station& operator=(const Station&) = delete;

  tl::expected<MessageId, Refusal> publish(const std::string& topic, std::string_view payload,
                                           Qos qos = Qos::at_least_once, bool retain = false) {
    return client->publish({.connection = heard.number(),
                            .topic = topic,
                            .payload = bytes(payload),
                            .qos = qos,
                            .retain = retain,
                            .need = Need::must});
  }

 private:
  std::unique_ptr<Thread> own_;

 public:
  Heard heard;
  std::unique_ptr<Client> client;
};

}  // namespace berth::mqtt::test
