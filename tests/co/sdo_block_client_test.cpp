// SDO block transfer, the client's side (docs/protocols/cia301.md §SDO; docs/hard-cases.md §1). A scripted server
// speaks by hand-written frames.
#include <gtest/gtest.h>
#include <algorithm>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "sdo_rig.hpp"

using namespace berth;
using namespace berth::test;

namespace {

struct BlockClient : ::testing::Test, Bench {
  BlockClient() { options.mode = co::SdoMode::block; }
  // What the server says when it has heard `request`, each time a line of frames; the last line is repeated.
  void reply(const std::string& request, std::vector<Log> lines) { table["605#" + request] = std::move(lines); }
  static Log frames(const std::vector<std::string>& data) {
    Log log;
    for (const auto& each : data) log.push_back("585#" + each);
    return log;
  }
  // The client's frames since the last call.
  Log said() {
    Log log;
    for (; seen < wire.log.size(); ++seen) {
      if (wire.log[seen].starts_with("605#")) log.push_back(wire.log[seen].substr(4));
    }
    return log;
  }
  Result<void> download(const Bytes& data) {
    auto op = client.download(node, 0x2004, 0, data, options);
    return await(*this, op);
  }
  Result<co::SdoValue> upload() {
    auto op = client.upload(node, 0x2004, 0, options);
    return await(*this, op);
  }
  std::map<std::string, std::vector<Log>> table;
  Peer server{wire, co::all_sdo_requests, [this](Peer& self, const can::Frame& f) {
                const auto it = table.find(can::to_string(f));
                if (it == table.end()) return;
                for (const auto& each : it->second.front()) self.send(each.c_str());
                if (it->second.size() > 1) it->second.erase(it->second.begin());
              }};
  static can::Frame segment(unsigned number) {
    auto frame = *can::parse_frame("585#0001020304050607");
    frame.data[0] = static_cast<std::uint8_t>(number);
    return frame;
  }
  // The server's frames that come after a while, each so long after the one before.
  struct Late final : rt::Job {
    explicit Late(BlockClient& test) : test_(&test) {}
    void send_each(rt::Duration time, Log frames) {
      time_ = time;
      frames_ = std::move(frames);
      sent_ = 0;
      test_->executor.after(time, *this);
    }
    void send_after(rt::Duration time, const std::string& frame) { send_each(time, {frame}); }
    void run() noexcept override {
      test_->server.send(frames_[sent_++].c_str());
      if (sent_ < frames_.size()) test_->executor.after(time_, *this);
    }

   private:
    BlockClient* test_;
    rt::Duration time_{};
    Log frames_;
    std::size_t sent_ = 0;
  } late{*this};
  Station station{wire};
  co::SdoClient client{station.dispatcher};
  co::SdoOptions options;
  const NodeId node{5};
  std::size_t seen = 0;
};

// A7.3: initiate with size and CRC, sub-block, end.
TEST_F(BlockClient, A7_3_Download) {
  const Bytes data = numbers(20);
  const auto segments = segments_of(data);
  const auto end = "C5" + le16(slow_crc(data)) + "0000000000";
  reply("C604200014000000", {{"585#A40420007F000000"}});
  reply(segments[2], {{"585#A2037F0000000000"}});
  reply(end, {{"585#A100000000000000"}});
  EXPECT_TRUE(download(data));
  Log expected{"C604200014000000"};
  expected.insert(expected.end(), segments.begin(), segments.end());
  expected.push_back(end);
  EXPECT_EQ(said(), expected);
  EXPECT_EQ(client.surplus(node), 0U);
}

// A7.4: initiate, start, sub-blocks, end.
TEST_F(BlockClient, A7_4_Upload) {
  const Bytes data = numbers(20);
  reply("A40420007F000000", {{"585#C604200014000000"}});
  reply("A300000000000000", {frames(segments_of(data))});
  reply("A2037F0000000000", {{"585#C5" + le16(slow_crc(data)) + "0000000000"}});
  const auto value = upload();
  ASSERT_TRUE(value);
  EXPECT_EQ(Bytes(value->bytes().begin(), value->bytes().end()), data);
  EXPECT_EQ(said(), (Log{"A40420007F000000", "A300000000000000", "A2037F0000000000", "A100000000000000"}));
  EXPECT_EQ(client.surplus(node), 0U);
  EXPECT_EQ(client.late(node), 0U);
}

// HC1.S3: a server that does not say how long the object is.
TEST_F(BlockClient, S3_UploadWithoutSize) {
  const Bytes data = numbers(7);
  reply("A40420007F000000", {{"585#C404200000000000"}});
  reply("A300000000000000", {frames(segments_of(data))});
  reply("A2017F0000000000", {{"585#C1" + le16(slow_crc(data)) + "0000000000"}});
  EXPECT_EQ(upload()->size(), 7U);
}

// HU.33: nothing at all, both ways: one empty segment, seven unused bytes.
TEST_F(BlockClient, HU_33_ZeroBytes) {
  reply("C604200000000000", {{"585#A40420007F000000"}});
  reply("8100000000000000", {{"585#A2017F0000000000"}});
  reply("DD00000000000000", {{"585#A100000000000000"}});
  EXPECT_TRUE(download({}));
  reply("A40420007F000000", {{"585#C604200000000000"}});
  reply("A300000000000000", {{"585#8100000000000000"}});
  reply("A2017F0000000000", {{"585#DD00000000000000"}});
  const auto value = upload();
  ASSERT_TRUE(value);
  EXPECT_TRUE(value->empty());
}

// HC1.S4: segments are lost: those behind the acknowledged ones are sent again, in sub-blocks of the new size.
TEST_F(BlockClient, HC1_S4_S7_RepeatsWhatWasLost) {
  const Bytes data = numbers(42);
  reply("C60420002A000000", {{"585#A404200006000000"}});
  reply(segments_of(data)[5], {{"585#A202030000000000"}});  // 2 of 6, next 3
  const Bytes rest(data.begin() + 14, data.end());
  const auto second = segments_of(Bytes(rest.begin(), rest.begin() + 21), false);
  reply(second[2], {{"585#A200020000000000"}});  // none of 3, next 2
  const auto third = segments_of(Bytes(rest.begin(), rest.begin() + 14), false);
  reply(third[1], {{"585#A2027F0000000000"}});
  const auto fourth = segments_of(Bytes(rest.begin() + 14, rest.end()));
  reply(fourth[1], {{"585#A2027F0000000000"}});
  const auto end = "C1" + le16(slow_crc(data)) + "0000000000";
  reply(end, {{"585#A100000000000000"}});
  EXPECT_TRUE(download(data));
  Log expected{"C60420002A000000"};
  for (const auto& block : {segments_of(data), second, third, fourth}) {
    expected.insert(expected.end(), block.begin(), block.end());
  }
  expected.push_back(end);
  EXPECT_EQ(said(), expected);
}

// HC1.S4: an upload with a lost segment: the last good one is acknowledged, smaller sub-blocks are asked for.
TEST_F(BlockClient, S4_UploadWithALostSegment) {
  const Bytes data = numbers(28);
  auto first = frames(segments_of(data));
  first.erase(first.begin() + 1);
  reply("A40420007F000000", {{"585#C60420001C000000"}});
  reply("A300000000000000", {first});
  reply("A2013F0000000000", {frames(segments_of(Bytes(data.begin() + 7, data.end())))});
  reply("A2033F0000000000", {{"585#C1" + le16(slow_crc(data)) + "0000000000"}});
  const auto value = upload();
  ASSERT_TRUE(value) << describe(value.error());
  EXPECT_EQ(Bytes(value->bytes().begin(), value->bytes().end()), data);
}

// HC1.S4: the last segment of an upload is lost: after a while of silence the rest is asked for.
TEST_F(BlockClient, S4_UploadWithTheLastSegmentLost) {
  const Bytes data = numbers(28);
  auto first = frames(segments_of(data));
  first.pop_back();
  reply("A40420007F000000", {{"585#C60420001C000000"}});
  reply("A300000000000000", {first});
  reply("A2033F0000000000", {frames(segments_of(Bytes(data.begin() + 21, data.end())))});
  reply("A2013F0000000000", {{"585#C1" + le16(slow_crc(data)) + "0000000000"}});
  const auto value = upload();
  ASSERT_TRUE(value) << describe(value.error());
  EXPECT_EQ(value->size(), 28U);
  EXPECT_LT(executor.now(), at(1s)) << "before anybody's time-out";
}

// A lost acknowledgement: the one who sends gives up.
TEST_F(BlockClient, LostAcknowledgement) {
  reply("C604200007000000", {{"585#A40420007F000000"}});
  const auto done = download(numbers(7));
  ASSERT_FALSE(done);
  EXPECT_EQ(done.error().code, Errc::timeout);
  run(10s);
  EXPECT_EQ(said().back(), "8004200000000405");
}

// HC1.S6: more acknowledged than sent.
TEST_F(BlockClient, S6_MoreAcknowledgedThanSent) {
  reply("C604200007000000", {{"585#A40420007F000000"}});
  reply(segments_of(numbers(7))[0], {{"585#A2027F0000000000"}});
  EXPECT_EQ(download(numbers(7)).error().detail, 0x05040003U);
  run(1ms);
  EXPECT_EQ(said().back(), "8004200003000405");
}

// HC1.S8: block sizes 0 and above 127.
TEST_F(BlockClient, S8_BlockSizes) {
  for (const char* size : {"00", "80", "FF"}) {
    reply("C60420000E000000", {{"585#A4042000" + std::string(size) + "000000"}});
    EXPECT_EQ(download(numbers(14)).error().detail, 0x05040002U);
    run(1ms);
    EXPECT_EQ(said().back(), "8004200002000405");
    reply("C60420000E000000", {{"585#A404200001000000"}});
    reply(segments_of(numbers(14))[0], {{"585#A201" + std::string(size) + "0000000000"}});
    EXPECT_EQ(download(numbers(14)).error().detail, 0x05040002U);
    run(1ms);
  }
  // Its own is put right.
  options.block_size = 0;
  auto op = client.upload(node, 0x2004, 0, options);
  Flag flag;
  op.begin(executor, flag);
  run(1ms);
  EXPECT_EQ(said().back(), "A404200001000000");
}

// A7.7: a segment whose number is not of the sub-block.
TEST_F(BlockClient, A7_7_SequenceNumbers) {
  options.block_size = 3;
  for (const char* wrong : {"585#0001020304050607", "585#0401020304050607", "585#FF01020304050607"}) {
    reply("A404200003000000", {{"585#C60420001C000000"}});
    reply("A300000000000000", {{wrong}});
    EXPECT_EQ(upload().error().detail, 0x05040003U) << wrong;
    run(1ms);
    EXPECT_EQ(said().back(), "8004200003000405");
  }
}

// HC1.S9, A7.6: a wrong CRC.
TEST_F(BlockClient, A7_6_S9_WrongCrc) {
  reply("A40420007F000000", {{"585#C604200007000000"}});
  reply("A300000000000000", {frames(segments_of(numbers(7)))});
  reply("A2017F0000000000", {{"585#C112340000000000"}});
  EXPECT_EQ(upload().error().detail, 0x05040004U);
  run(1ms);
  EXPECT_EQ(said().back(), "8004200004000405");
}

// HC1.S10: CRC on one side only, either.
TEST_F(BlockClient, S10_CrcOnOneSide) {
  reply("C604200007000000", {{"585#A00420007F000000"}});
  reply(segments_of(numbers(7))[0], {{"585#A2017F0000000000"}});
  reply("C100000000000000", {{"585#A100000000000000"}});
  EXPECT_TRUE(download(numbers(7)));
  reply("A40420007F000000", {{"585#C204200007000000"}});
  reply("A300000000000000", {frames(segments_of(numbers(7)))});
  reply("A2017F0000000000", {{"585#C112340000000000"}});
  EXPECT_TRUE(upload());
  options.crc = false;
  reply("C204200007000000", {{"585#A40420007F000000"}});
  EXPECT_TRUE(download(numbers(7)));
  reply("A00420007F000000", {{"585#C604200007000000"}});
  EXPECT_TRUE(upload());
}

// HC1.S11, A7.5: the server switches to a normal upload.
TEST_F(BlockClient, S11_A7_5_ProtocolSwitch) {
  options.protocol_switch = 20;
  reply("A40420007F140000", {{"585#4304200001020304"}});
  const auto small = upload();
  ASSERT_TRUE(small);
  EXPECT_EQ(hex(Bytes(small->bytes().begin(), small->bytes().end())), "01020304");
  reply("A40420007F140000", {{"585#410420000A000000"}});
  reply("6000000000000000", {{"585#0061626364656667"}});
  reply("7000000000000000", {{"585#1968696A00000000"}});
  EXPECT_EQ(upload()->text(), "abcdefghij");
}

// A server without block transfer: once more, segmented; as an option.
TEST_F(BlockClient, FallsBackToSegmented) {
  reply("C604200008000000", {{"585#8004200001000405"}});
  reply("2104200008000000", {{"585#6004200000000000"}});
  reply("0001020304050607", {{"585#2000000000000000"}});
  reply("1D08000000000000", {{"585#3000000000000000"}});
  EXPECT_TRUE(download({1, 2, 3, 4, 5, 6, 7, 8}));
  reply("A40420007F000000", {{"585#8004200001000405"}});
  reply("4004200000000000", {{"585#4304200001020304"}});
  EXPECT_EQ(upload()->size(), 4U);
  options.fall_back = false;
  EXPECT_EQ(upload().error().detail, 0x05040001U);
  // Any other refusal is one.
  options.fall_back = true;
  reply("A40420007F000000", {{"585#8004200000000206"}});
  EXPECT_EQ(upload().error().detail, 0x06020000U);
}

// `automatic`: in blocks from a length on; an upload says below which it need not be.
TEST_F(BlockClient, AutomaticMode) {
  options.mode = co::SdoMode::automatic;
  options.block_from = 8;
  reply("A40420007F070000", {{"585#4304200001020304"}});
  EXPECT_EQ(upload()->size(), 4U);
  reply("2104200007000000", {{"585#6004200000000000"}});
  reply("0101020304050607", {{"585#2000000000000000"}});
  EXPECT_TRUE(download({1, 2, 3, 4, 5, 6, 7}));
  said();
  reply("C604200008000000", {{"585#8004200022000008"}});
  EXPECT_FALSE(download({1, 2, 3, 4, 5, 6, 7, 8}));
  EXPECT_EQ(said(), Log{"C604200008000000"});
  // The default is what every server can.
  EXPECT_EQ(co::SdoOptions().mode, co::SdoMode::segmented);
}

// HC1.S12: the server refuses at the end.
TEST_F(BlockClient, S12_WriteErrorAtTheEnd) {
  reply("C604200007000000", {{"585#A40420007F000000"}});
  reply(segments_of(numbers(7))[0], {{"585#A2017F0000000000"}});
  reply("C1" + le16(slow_crc(numbers(7))) + "0000000000", {{"585#8004200000000606"}});
  const auto done = download(numbers(7));
  EXPECT_EQ(done.error().code, Errc::aborted);
  EXPECT_EQ(done.error().detail, 0x06060000U);
  run(10s);
  EXPECT_EQ(said().size(), 3U) << "nothing more is sent";
}

// HC1.S13: an abort in the middle of sub-blocks, either way, ends it and is not answered.
TEST_F(BlockClient, S13_AbortInTheMiddle) {
  reply("A40420007F000000", {{"585#C60420001C000000"}});
  reply("A300000000000000", {{"585#0101020304050607", "585#8004200000000008"}});
  EXPECT_EQ(upload().error().detail, 0x08000000U);
  run(10s);
  EXPECT_EQ(said().size(), 2U);
  reply("C60420007A030000", {{"585#A40420007F000000"}});
  reply(segments_of(numbers(890))[20], {{"585#8004200021000008"}});
  EXPECT_EQ(download(numbers(890)).error().detail, 0x08000021U);
  run(10s);
  const auto frames = said();
  EXPECT_LE(frames.size(), 22U + 2 * co::sdo::BlockPump::burst) << "what was queued, but no more";
  EXPECT_NE(frames.back().substr(0, 2), "80");
}

// HC1.S17: lengths that are not as indicated.
TEST_F(BlockClient, S17_LengthMismatch) {
  reply("A40420007F000000", {{"585#C604200008000000"}});
  reply("A300000000000000", {frames(segments_of(numbers(7)))});
  reply("A2017F0000000000", {{"585#C1" + le16(slow_crc(numbers(7))) + "0000000000"}});
  EXPECT_EQ(upload().error().detail, 0x06070013U);
  reply("A40420007F000000", {{"585#C604200006000000"}});
  EXPECT_EQ(upload().error().detail, 0x06070012U);
  reply("A40420007F000000", {{"585#C6042000FFFFFFFF"}});
  EXPECT_EQ(upload().error().detail, 0x05040005U) << "longer than allowed";
  options.longest = 6;
  reply("A40420007F000000", {{"585#C404200000000000"}});
  EXPECT_EQ(upload().error().detail, 0x05040005U);
}

// HC1.S19: a sub-block and a port that holds a few frames only: none is lost, none comes twice, and the queue holds
// but a few of them at any time.
TEST_F(BlockClient, S19_FullTransmitQueue) {
  const Bytes data = numbers(889);
  reply("C604200079030000", {{"585#A40420007F000000"}});
  reply(segments_of(data)[126], {{"585#A27F7F0000000000"}});
  reply("C1" + le16(slow_crc(data)) + "0000000000", {{"585#A100000000000000"}});
  for (const std::size_t room : {1U, 2U, 3U, 5U, 32U}) {
    station.port.capacity = room;
    said();
    ASSERT_TRUE(download(data)) << room;
    const auto all = said();
    ASSERT_EQ(all.size(), 129U) << room;
    EXPECT_EQ(Log(all.begin() + 1, all.end() - 1), segments_of(data)) << room;
  }
  // Somebody else's frames fill the queue for a while.
  station.port.capacity = 4;
  auto op = client.download(node, 0x2004, 0, data, options);
  Flag flag;
  op.begin(executor, flag);
  std::size_t most = 0;
  for (unsigned step = 0; !flag.set && executor.step(at(100s)); ++step) {
    if (step % 32 < 16) station.send("701#05");
    most = std::max(most, station.port.queued());
  }
  EXPECT_TRUE(op.await_resume());
  EXPECT_LE(most, 4U);
}

// HC1.S19: the queue is bounded by us, not only by the port.
TEST_F(BlockClient, S19_ASubBlockIsPaced) {
  const Bytes data = numbers(889);
  reply("C604200079030000", {{"585#A40420007F000000"}});
  station.port.capacity = 1000;
  auto op = client.download(node, 0x2004, 0, data, options);
  Flag flag;
  op.begin(executor, flag);
  std::size_t most = 0;
  for (int i = 0; i < 300; ++i) {
    executor.step(at(1s));
    most = std::max(most, station.port.queued());
  }
  EXPECT_LE(most, 2 * co::sdo::BlockPump::burst);
  EXPECT_GE(most, 2U) << "the port never runs empty within a sub-block";
}

// The segments never leave.
TEST_F(BlockClient, SegmentsThatNeverLeave) {
  reply("C604200007000000", {{"585#A40420007F000000"}});
  const Bytes data = numbers(7);
  for (const auto why : {can::Queued::full, can::Queued::bus_off, can::Queued::closed}) {
    auto op = client.download(node, 0x2004, 0, data, options);
    Flag flag;
    op.begin(executor, flag);
    run(150us);  // the initiate is out
    station.port.refuses = why;
    run(10s);
    ASSERT_TRUE(flag.set);
    EXPECT_EQ(op.await_resume().error().code, Errc::bus);
    station.port.refuses.reset();
    EXPECT_FALSE(client.busy(node));
  }
  {
    auto op = client.download(node, 0x2004, 0, data, options);
    Flag flag;
    op.begin(executor, flag);
    run(150us);
    station.port.mute = true;
    run(10s);
    ASSERT_TRUE(flag.set);
    EXPECT_EQ(op.await_resume().error().code, Errc::bus);
    station.port.mute = false;
  }
}

// Destroyed or cancelled at any instant of a block transfer: one abort at most, the next one is unharmed.
TEST_F(BlockClient, CancelAndDestroyAtAnyTime) {
  const Bytes data = numbers(200);
  od::Values values(test_description(), NodeId(6));
  Station other(wire);
  co::SdoServerService honest(other.dispatcher, values, 1024);
  honest.start(NodeId(6));
  for (const bool up : {false, true}) {
    values.set_bytes({0x2004, 0}, data);
    for (auto time = 0us; time < 9000us; time += 70us) {
      {
        auto down_op = client.download(NodeId(6), 0x2004, 0, data, options);
        auto up_op = client.upload(NodeId(6), 0x2004, 0, options);
        Flag flag;
        if (up) {
          up_op.begin(executor, flag);
        } else {
          down_op.begin(executor, flag);
        }
        run(time);
        if (time % 140us == 0us) {
          client.cancel(NodeId(6));
          run(1ms);
          EXPECT_TRUE(flag.set);
        }
      }
      EXPECT_FALSE(client.busy(NodeId(6)));
      run(3s);  // a server that collects a sub-block cannot be asked anything else before it gives up
      auto next = client.read<std::uint32_t>(NodeId(6), 0x1000, 0);
      const auto value = await(*this, next);
      ASSERT_TRUE(value) << time.count() << (up ? " up: " : " down: ") << describe(value.error());
      EXPECT_EQ(*value, 0x00020192U);
    }
  }
}

// The server gives up in the middle of a sub-block that is going out: the next attempt begins with its initiate, and no
// segment of the first comes behind it.
TEST_F(BlockClient, TheServersTimeoutIsRetried) {
  const Bytes data = numbers(300);
  options.retries = 1;
  reply("C60420002C010000", {{"585#A40420007F000000"}, {"585#A40420007F000000"}});
  reply(segments_of(data)[9], {{"585#8004200000000405"}, {}});
  reply(segments_of(data)[42], {{"585#A22B7F0000000000"}});
  reply("C5" + le16(slow_crc(data)) + "0000000000", {{"585#A100000000000000"}});
  const auto done = download(data);
  ASSERT_TRUE(done) << describe(done.error());
  const auto all = said();
  const auto again = std::ranges::find(all.begin() + 1, all.end(), "C60420002C010000");
  ASSERT_NE(again, all.end());
  EXPECT_EQ(Log(again + 1, all.end() - 1), segments_of(data));
}

// Retries begin the whole transfer anew.
TEST_F(BlockClient, Retries) {
  options.retries = 1;
  reply("C604200007000000", {{}, {"585#A40420007F000000"}});
  reply(segments_of(numbers(7))[0], {{"585#A2017F0000000000"}});
  reply("C1" + le16(slow_crc(numbers(7))) + "0000000000", {{"585#A100000000000000"}});
  EXPECT_TRUE(download(numbers(7)));
  reply("A40420007F000000", {{"585#C604200007000000"}});
  reply("A300000000000000", {{}, frames(segments_of(numbers(7)))});
  reply("A2017F0000000000", {{"585#C1" + le16(slow_crc(numbers(7))) + "0000000000"}});
  EXPECT_EQ(upload()->size(), 7U);
}

// A server may take what it is sent one segment at a time, each answer just within the time-out, for ever.
TEST_F(BlockClient, ADownloadThatTricklesIsGivenUp) {
  server.action = [this](Peer& self, const can::Frame& f) {
    if (f.data[0] == 0xC6) self.send("585#A404200001000000");
    if (f.data[0] == 0x01) late.send_after(900ms, "585#A201010000000000");
  };
  const auto done = download(numbers(4000));
  ASSERT_FALSE(done);
  EXPECT_EQ(done.error().code, Errc::timeout);
  EXPECT_LT(executor.now(), at(12s));
  run(100ms);  // the abort leaves
  const auto frames = said();
  EXPECT_EQ(frames.back(), "8004200000000405");
  EXPECT_LT(frames.size(), 14U) << "8 time-outs of 1 s, and what 64 bytes a second allow: 900 ms a segment";
}

// As slow, but for no longer than it may: 8 segments in 7.2 s.
TEST_F(BlockClient, AShortDownloadMayTrickle) {
  server.action = [this](Peer& self, const can::Frame& f) {
    if (f.data[0] == 0xC6) self.send("585#A404200001000000");
    if (f.data[0] == 0x01 || f.data[0] == 0x81) late.send_after(900ms, "585#A201010000000000");
    if ((f.data[0] & 0xE1U) == 0xC1) self.send("585#A100000000000000");
  };
  EXPECT_TRUE(download(numbers(56)));
}

// 70 bytes a second, and the first acknowledgement after 12.7 s: what came of a sub-block counts before it is over.
TEST_F(BlockClient, AnUploadAsSlowAsItMayBeIsNotGivenUp) {
  const auto segments = segments_of(numbers(889));
  server.action = [&](Peer& self, const can::Frame& f) {
    if (f.data[0] == 0xA4) self.send("585#C404200000000000");
    if (f.data[0] == 0xA3) late.send_each(100ms, frames(segments));
    if (f.data[0] == 0xA2) self.send(("585#C1" + le16(slow_crc(numbers(889))) + "0000000000").c_str());
  };
  const auto value = upload();
  ASSERT_TRUE(value) << describe(value.error());
  EXPECT_EQ(value->size(), 889U);
}

// An upload without a length whose segments never end: fast ones end at the longest that is allowed, slow ones by time.
TEST_F(BlockClient, AnUploadThatNeverEndsIsGivenUp) {
  options.longest = 4000;
  server.action = [&](Peer& self, const can::Frame& f) {
    if (f.data[0] == 0xA4) self.send("585#C404200000000000");
    if (f.data[0] != 0xA3 && f.data[0] != 0xA2) return;
    self.port.capacity = 200;
    for (unsigned number = 1; number <= 127; ++number) self.dispatcher.send(segment(number));
  };
  const auto value = upload();
  ASSERT_FALSE(value);
  EXPECT_EQ(value.error().detail, 0x0504'0005U);
  run(100ms);
  EXPECT_EQ(said().back(), "8004200005000405");
}

TEST_F(BlockClient, AnUploadThatTricklesIsGivenUp) {
  for (const bool whole_blocks : {false, true}) {
    options.block_size = whole_blocks ? 1 : 127;
    const auto began = executor.now();
    server.action = [&](Peer& self, const can::Frame& f) {
      if ((f.data[0] & 0xE3U) == 0xA0) self.send("585#C404200000000000");
      if (f.data[0] != 0xA3 && f.data[0] != 0xA2) return;
      late.send_after(whole_blocks ? 450ms : 200ms, can::to_string(segment(1)));
    };
    const auto value = upload();
    ASSERT_FALSE(value);
    EXPECT_EQ(value.error().code, Errc::timeout);
    EXPECT_LT(executor.now() - began, 12s);
    run(1s);
    EXPECT_EQ(said().back(), "8004200000000405");
  }
}

}  // namespace
