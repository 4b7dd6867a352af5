"""Grade what students hand in: `make grade FOLDER=submissions`.

    python -m classroom.grade FOLDER            in a container for each lesson that is judged
    python -m classroom.grade FOLDER --trust    as you, on this machine: only for code that you know

    submissions   whose file is it? From the names that Moodle and Canvas give
    answers       which lesson is it, and what has the student written? As text: nothing runs
    judge         runs the lesson with the answers, in the container: the only part that does
    limits        what the code of a student may use, and what is said of code that used more
    runner        starts `judge`, reads what it says, and ends it
    results       what is judged, kept so that a second run goes on
    tables        grades.csv, and the files that Moodle and Canvas import
    feedback      the lesson of a student with the verdicts
    alike         whose answers are alike
    reach         does an answer name what judges it? As text
    witness       does it change what judges it? In the kernel, from before the answer on
    marking       what a task is worth
    uses, source  what a verdict depends on: so it is kept as long as it can be

A student's notebook is read as JSON, and never run: the text of its exercise cells goes into the
lesson of this checkout. What `judge` says back is data from hostile code, and is read as such.
"""
