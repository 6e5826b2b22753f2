// `GET /metrics` of a running server: who gets it, and that its numbers are those of the bus.
#include "berth/can/bus_error.hpp"
#include "berth/can/length.hpp"
#include "metrics_reader.hpp"
#include "server_fixture.hpp"

#include <chrono>
#include <thread>

#include "../pch.hpp"

namespace berth::studio {
namespace {

using test::MetricsPage;

class StudioMetricsServer : public StudioServer {
 protected:
  std::string authorised(command::Role role) const { return "Authorization: Bearer " + token(role) + "\r\n"; }
  static MetricsPage read(const std::string& answer, bool open = false) {
    return MetricsPage(answer.substr(answer.find("\r\n\r\n") + 4), open);
  }
  MetricsPage page_now() {
    auto client = connect();
    client->say(head("GET /metrics", authorised(command::Role::view)));
    return read(client->answer());
  }
  /// Asks again until it is so; the figures come once a second.
  bool until(const std::function<bool(const MetricsPage& page)>& so) {
    for (int i = 0; i < 200; ++i) {
      if (so(page_now())) return true;
      for (int turn = 0; turn < 20; ++turn) loop_.turn(5ms);
    }
    return false;
  }
  const MetricsPage::Labels field_{{"bus", "field"}};
  const MetricsPage::Labels drive_{{"bus", "field"}, {"slot", "drive"}};
};

TEST_F(StudioMetricsServer, AnyTokenOpensItAndNoneDoesNot) {
  EXPECT_EQ(status_of(head("GET /metrics")), "HTTP/1.1 401");
  EXPECT_EQ(status_of(head("GET /metrics?a=b")), "HTTP/1.1 401");
  EXPECT_EQ(status_of(head("GET /metrics", "Authorization: Bearer " + std::string(64, '0') + "\r\n")), "HTTP/1.1 401");
  for (const auto role : command::all_roles)
    EXPECT_EQ(status_of(head("GET /metrics", authorised(role))), "HTTP/1.1 200");
  EXPECT_EQ(status_of("GET /metrics HTTP/1.1\r\nHost: evil.example\r\n" + authorised(command::Role::view) + "\r\n"),
            "HTTP/1.1 403");
  EXPECT_EQ(status_of(head("DELETE /metrics", authorised(command::Role::view))), "HTTP/1.1 405");
  EXPECT_EQ(status_of(head("GET /metricsx", authorised(command::Role::view))), "HTTP/1.1 404");
}

TEST_F(StudioMetricsServer, WithoutATokenOnlyIfThatWasAllowed) {
  start(1U << 16U, true);
  EXPECT_EQ(status_of(head("GET /metrics")), "HTTP/1.1 200");
  EXPECT_EQ(status_of("GET /metrics HTTP/1.1\r\nHost: evil.example\r\n\r\n"), "HTTP/1.1 403");
  EXPECT_EQ(status_of(head("GET /api/v1/snapshot")), "HTTP/1.1 401") << "that is another thing";
}

TEST_F(StudioMetricsServer, TheFormIsTheOneAskedFor) {
  auto client = connect();
  client->say(head("GET /metrics", authorised(command::Role::view)));
  auto answer = client->answer();
  EXPECT_NE(answer.find("Content-Type: text/plain; version=0.0.4; charset=utf-8\r\n"), std::string::npos) << answer;
  static_cast<void>(read(answer));
  client->say(head("GET /metrics", authorised(command::Role::view) + "Accept: application/openmetrics-text\r\n"));
  answer = client->answer();
  EXPECT_NE(answer.find("Content-Type: application/openmetrics-text; version=1.0.0"), std::string::npos) << answer;
  static_cast<void>(read(answer, true));
}

TEST_F(StudioMetricsServer, FramesErrorsAndAbortsAreThoseOfTheBus) {
  const auto abort = can::Frame::base(0x585, {0x80, 0x00, 0x10, 0x00, 0, 0, 2, 6});
  const auto beat = can::Frame::base(0x705, {0x05});
  for (int i = 0; i < 3; ++i) studio_->frame("field", abort, rt::Time(1ms * i), false);
  for (int i = 0; i < 10; ++i) studio_->frame("field", beat, rt::Time(10ms * i), false);
  studio_->error("field", can::Frame::ext(0x88, {0, 0, 0, 0, 0, 0, 0, 0}), rt::Time(1s), "");
  ASSERT_TRUE(until([&](const auto& page) {
    return page.value("berth_bus_frames_total", field_) == 13 && page.value("berth_bus_errors_total", field_) == 1;
  }));
  const auto page = page_now();
  const double bits = 3.0 * can::exact_bits(abort) + 10.0 * can::exact_bits(beat);
  EXPECT_NEAR(*page.value("berth_bus_busy_seconds_total", field_), bits / 125'000, 1e-9);
  EXPECT_EQ(page.value("berth_slot_sdo_aborts_total", drive_), 3);
  EXPECT_EQ(page.value("berth_bus_sdo_aborts_total", field_), 3);
  EXPECT_EQ(page.value("berth_build_info", {{"version", "1.2.3"}}), 1);
  EXPECT_EQ(page.value("berth_machine_info", {{"machine", "bench"}, {"simulated", "true"}}), 1);
  EXPECT_EQ(page.value("berth_slots", {{"bus", "field"}, {"state", "unknown"}}), 1);
  EXPECT_EQ(page.value("berth_slot_operational", drive_), 0);
  EXPECT_EQ(page.value("berth_slot_required", drive_), 1);
  EXPECT_EQ(page.value("berth_slot_info", {{"bus", "field"}, {"slot", "drive"}, {"node_id", "5"}}), 1);
  EXPECT_EQ(page.value("berth_bus_state", {{"bus", "field"}, {"state", "active"}}), 1);
}

TEST_F(StudioMetricsServer, TimersThatRunLateAreSeen) {
  ASSERT_TRUE(until([](const auto& page) { return page.value("berth_loop_latency_seconds_count").value_or(0) > 0; }));
  const auto late = [](const MetricsPage& page) {
    return *page.value("berth_loop_latency_seconds_count") -
           *page.value("berth_loop_latency_seconds_bucket", {{"le", "0.25"}});
  };
  const double before = late(page_now());
  std::this_thread::sleep_for(600ms);  // the loop is held up
  EXPECT_TRUE(until([&](const auto& page) { return late(page) > before; }));
}

// The server's thread answers with what it has while the executor does nothing, and says how old that is.
TEST_F(StudioMetricsServer, AScrapeDoesNotWaitForTheExecutor) {
  ASSERT_TRUE(until([](const auto& page) { return page.value("berth_figures_age_seconds").has_value(); }));
  const auto asked = [&] {
    Connection client(studio_->where().port, [] { std::this_thread::sleep_for(1ms); });
    client.say(head("GET /metrics", authorised(command::Role::view)));
    return read(client.answer());
  };
  const double first = *asked().value("berth_figures_age_seconds");
  std::this_thread::sleep_for(200ms);
  const auto page = asked();
  EXPECT_GE(*page.value("berth_figures_age_seconds"), first + 0.2);
  EXPECT_EQ(page.value("berth_slot_required", drive_), 1);
}

// A scrape at once after the start gets a page, with or without figures.
TEST_F(StudioMetricsServer, AScrapeWhileStartingIsAnswered) {
  for (int i = 0; i < 5; ++i) {
    start();
    Connection client(studio_->where().port, [] { std::this_thread::sleep_for(1ms); });
    client.say(head("GET /metrics", authorised(command::Role::view)));
    EXPECT_EQ(read(client.answer()).value("berth_build_info", {{"version", "1.2.3"}}), 1);
  }
}

}  // namespace
}  // namespace berth::studio
