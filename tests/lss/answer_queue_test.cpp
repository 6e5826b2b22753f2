// What is answered is sent in order, and not when nobody waits for it any more (S4.10).
#include <gtest/gtest.h>
#include <string>
#include <vector>

#include "berth/lss/answer_queue.hpp"

#include "lss_world.hpp"

namespace berth::lss::test {
namespace {

struct Queue {
  Queue() : dispatcher(world.executor(), *port), queue(dispatcher) {}
  sim::World world;
  sim::Bus& bus = world.add_bus("bus", 125'000);
  std::unique_ptr<sim::Controller> port = bus.attach({.queue = sim::TxOrder::priority});
  std::unique_ptr<sim::Controller> other = bus.attach();
  can::Dispatcher dispatcher;
  AnswerQueue queue;
  const Record record{bus};
  const can::Frame feedback = feedback_frame({Feedback::extended, false, 5});
  const can::Frame identified = answer(Command::identified);
  using Lines = std::vector<std::string>;
};

TEST(LssAnswerQueue, S4_10_InOrderOnAControllerThatSendsByPriority) {
  Queue q;
  q.queue.send({q.feedback, q.identified});
  q.world.run_for(milliseconds(10));
  EXPECT_EQ(q.record.text, (Queue::Lines{"1F900005#", "7E4#4F00000000000000"}));
}

TEST(LssAnswerQueue, ANewerRequestDropsWhatWaits) {
  Queue q;
  q.port->silent(true);  // the bus has no place for it
  q.queue.send({q.feedback, q.identified});
  q.world.run_for(milliseconds(5));
  q.queue.send({});  // the next request, which is not answered
  q.port->silent(false);
  q.world.run_for(milliseconds(10));
  EXPECT_EQ(q.record.text, Queue::Lines{});
  q.queue.send({q.feedback, q.identified});
  q.world.run_for(milliseconds(10));
  EXPECT_EQ(q.record.text.size(), 2U);
}

TEST(LssAnswerQueue, WaitsABoundedTime) {
  Queue q;
  q.port->silent(true);
  q.queue.send({q.feedback, q.identified});
  q.world.run_for(AnswerQueue::longest + milliseconds(1));
  q.port->silent(false);
  q.world.run_for(milliseconds(10));
  EXPECT_EQ(q.record.text, Queue::Lines{});
}

TEST(LssAnswerQueue, OffWithTheFeedbackOnTheWireIsSilentThen) {
  Queue q;
  q.queue.send({q.feedback, q.identified});
  q.world.run_for(microseconds(100));
  q.queue.drop();
  q.world.run_for(milliseconds(10));
  EXPECT_EQ(q.record.text, Queue::Lines{"1F900005#"});
}

TEST(LssAnswerQueue, AFullQueueSendsNothing) {
  Queue q;
  q.port->silent(true);
  while (q.dispatcher.send(*can::parse_frame("100#")) == can::Queued::yes) {
  }
  q.queue.send({q.feedback, q.identified});
  q.port->silent(false);
  q.world.run_for(milliseconds(200));
  for (const auto& line : q.record.text) EXPECT_EQ(line, "100#");
}

}  // namespace
}  // namespace berth::lss::test
