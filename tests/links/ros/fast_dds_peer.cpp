// Peer on Fast DDS with types of fastddsgen: counts what it hears of a flight, gives it a goal, then commands.
//
//     peer DOMAIN SECONDS X Y Z JOINT ANGLE NUMBER...
//
// The goal (m) and that of a joint (rad) are sent for SECONDS, then the numbers of a command for half a second; it then
// prints how many messages of each topic it has heard, the last pose and the last joint states.
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <thread>

#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>

#include "LivePubSubTypes.h"

using namespace eprosima::fastdds::dds;

static DomainParticipant* participant;
static Publisher* publisher;
static Subscriber* subscriber;

template <typename PubSub> DataWriter* writer(const char* topic, const char* type) {
    TypeSupport support(new PubSub());
    support.register_type(participant, type);
    return publisher->create_datawriter(participant->create_topic(topic, type, TOPIC_QOS_DEFAULT), DATAWRITER_QOS_DEFAULT);
}

template <typename PubSub> DataReader* reader(const char* topic, const char* type, bool latched = false) {
    TypeSupport support(new PubSub());
    support.register_type(participant, type);
    DataReaderQos qos = DATAREADER_QOS_DEFAULT;
    qos.reliability().kind = RELIABLE_RELIABILITY_QOS;
    qos.history().depth = 100;
    if (latched) qos.durability().kind = TRANSIENT_LOCAL_DURABILITY_QOS;
    return subscriber->create_datareader(participant->create_topic(topic, type, TOPIC_QOS_DEFAULT), qos);
}

template <typename Message> long drain(DataReader* reader, Message& last) {
    SampleInfo info;
    long count = 0;
    while (reader->take_next_sample(&last, &info) == ReturnCode_t::RETCODE_OK) count += info.valid_data;
    return count;
}

int main(int argc, char** argv) {
    const double seconds = std::atof(argv[2]);
    participant = DomainParticipantFactory::get_instance()->create_participant(std::atoi(argv[1]), PARTICIPANT_QOS_DEFAULT);
    publisher = participant->create_publisher(PUBLISHER_QOS_DEFAULT);
    subscriber = participant->create_subscriber(SUBSCRIBER_QOS_DEFAULT);
    auto odom = reader<nav_msgs::msg::dds_::Odometry_PubSubType>("rt/odom", "nav_msgs::msg::dds_::Odometry_");
    auto joints = reader<sensor_msgs::msg::dds_::JointState_PubSubType>("rt/joint_states", "sensor_msgs::msg::dds_::JointState_");
    auto frames = reader<tf2_msgs::msg::dds_::TFMessage_PubSubType>("rt/tf", "tf2_msgs::msg::dds_::TFMessage_");
    auto fixed = reader<tf2_msgs::msg::dds_::TFMessage_PubSubType>("rt/tf_static", "tf2_msgs::msg::dds_::TFMessage_", true);
    auto clock = reader<rosgraph_msgs::msg::dds_::Clock_PubSubType>("rt/clock", "rosgraph_msgs::msg::dds_::Clock_");
    auto command = writer<std_msgs::msg::dds_::Float64MultiArray_PubSubType>("rt/skyarm/command", "std_msgs::msg::dds_::Float64MultiArray_");
    auto goal = writer<geometry_msgs::msg::dds_::PoseStamped_PubSubType>("rt/skyarm/goal", "geometry_msgs::msg::dds_::PoseStamped_");
    auto posture = writer<sensor_msgs::msg::dds_::JointState_PubSubType>("rt/skyarm/joint_goal", "sensor_msgs::msg::dds_::JointState_");

    long odometry = 0, states = 0, transforms = 0, statics = 0, clocks = 0;
    nav_msgs::msg::dds_::Odometry_ pose;
    sensor_msgs::msg::dds_::JointState_ state;
    tf2_msgs::msg::dds_::TFMessage_ frame, constant;
    rosgraph_msgs::msg::dds_::Clock_ now;
    const auto begin = std::chrono::steady_clock::now();
    for (int turn = 0;; turn++) {
        const double passed = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
        if (passed > seconds + 0.5) break;
        odometry += drain(odom, pose);
        states += drain(joints, state);
        transforms += drain(frames, frame);
        statics += drain(fixed, constant);
        clocks += drain(clock, now);
        if (passed > seconds) {
            std_msgs::msg::dds_::Float64MultiArray_ numbers;
            for (int i = 8; i < argc; i++) numbers.data().push_back(std::atof(argv[i]));
            command->write(&numbers);
        } else if (turn % 200 == 100) {
            geometry_msgs::msg::dds_::PoseStamped_ there;
            there.header().frame_id("world");
            there.pose().position().x(std::atof(argv[3]));
            there.pose().position().y(std::atof(argv[4]));
            there.pose().position().z(std::atof(argv[5]));
            there.pose().orientation().w(1.0);
            goal->write(&there);
            sensor_msgs::msg::dds_::JointState_ angles;
            angles.name({argv[6]});
            angles.position({std::atof(argv[7])});
            posture->write(&angles);
        }
        std::this_thread::sleep_for(std::chrono::milliseconds(2));
    }
    std::printf("odom %ld joint_states %ld tf %ld tf_static %ld clock %ld\n", odometry, states, transforms, statics, clocks);
    std::printf("%s %s %.9f %.9f %.9f\n", pose.header().frame_id().c_str(), pose.child_frame_id().c_str(),
                pose.pose().pose().position().x(), pose.pose().pose().position().y(), pose.pose().pose().position().z());
    for (size_t i = 0; i < state.name().size(); i++) std::printf("%s %.9f\n", state.name()[i].c_str(), state.position()[i]);
    std::printf("%zu fixed, %zu moving frames, %d.%09u s\n", constant.transforms().size(), frame.transforms().size(),
                now.clock().sec(), now.clock().nanosec());
    std::fflush(stdout);
    std::_Exit(0);  // as a program that is killed: it does not take leave
}
